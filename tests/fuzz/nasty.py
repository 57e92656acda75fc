"""What is put into valid inputs: values at the ends of their ranges, and what only a text can say."""

NUMBERS = (
    0, 1, -1, 2, 3, 6, 7, 16, 24, 25, 48, 49, 64, 65, 127, 128, 250, 255, 256, 1000, 2**16, 2**31 - 1, 2**31,
    2**32 - 1, 2**32, 2**48 - 1, 2**48, 2**53, 2**56, 2**63 - 1, 2**63, 2**64 - 1, -(2**31), -(2**63), 0.0, -0.0,
    0.01, 0.5, 1e-9, 5e-324, 1e6, 1e300, float("inf"), float("-inf"), float("nan"),
)  # fmt: skip
TEXTS = (
    "", " ", "\0", "\x1b[2J", "a\nb", "\r\n", "\ufeff", "\u202e", "é", "e\u0301", "٣", "¹", "yes", "off",
    "null", "true", "1e3", "~", "..", "../x", "/dev/null", "x" * 300, "\ud800", "rsc", "custom", "tree", "a:b",
    "a=b", "-", "_", "%s", "{0}", "\\", "'", '"',
)  # fmt: skip
# What a tree cannot hold, but its text can.
RAW_JSON = (
    "1e999", "-1e999", "NaN", "-Infinity", "9" * 5000, "1e-5000", "0" * 50, "01", "+1", ".5", "5.", '"\\ud800"',
    '"\\u0000"', "[" * 20_000, '{"a":' * 3000, '"a": 1, "a": 2', "tru", "\ufeff{}", "", ",", "}", "/* */ 1",
    "\t1", '"\t"',
)  # fmt: skip
RAW_YAML = (
    *RAW_JSON, "&a [*a]", "*a", "!!python/name:os.system", "!!binary aa", "!x y", "!<%0a> y", '"\\U00110000"',
    '"\\UFFFFFFFF"', '"\\xff"', "<<: {a: 1}", "? a", "- - - a", "|\n a", ">99\n a", "12:34", "1_000", "0x1f",
    "010", "2024-01-01", ".inf", ".NaN", "@", "`", "%YAML 1.9", "\n---\n", "\n...\n", "# x\n", "1e3", "-.inf",
    "=", "''", "'", '"',
)  # fmt: skip
RAW_MSGPACK = (
    b"\xc1", b"\xdd\xff\xff\xff\xff", b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b"\xdb\xff\xff\xff\xff",
    b"\x91" * 1200, b"\x81\x01" * 600, b"\x81\x90\x01", b"\x81\xc4\x01a\x01", b"\xd6\xff\xff\xff\xff\xff",
    b"\xc7\x0c\xff" + b"\xff" * 12, b"\xd4\x05\x00", b"\xa1\xff", b"\xcb", b"\x82\xa1a\x01\xa1a\x02",
    b"\xca\x7f\xc0\x00\x00", b"\xcf" + b"\xff" * 8, b"\xd3\x80" + b"\0" * 7, b"\x81\x80\x01", b"\xc0\xc0",
)  # fmt: skip
HEADERS = (
    b"'shape': (1000000000000,)", b"'shape': (-1,)", b"'shape': (2147483648, 2147483648, 2)", b"'shape': ()",
    b"'shape': 5", b"'shape': (1.5,)", b"'shape': (" + b"(" * 300, b"'descr': '|O'", b"'descr': '<U9'",
    b"'descr': '<f4'", b"'descr': [('a', '<f8')]", b"'descr': '<c16'", b"'descr': 5", b"'fortran_order': True",
    b"'x': 1", b"'shape': (" + b"9" * 5000 + b",)", b"'descr': '<M8[s]'",
)  # fmt: skip
