"""Stand-ins for what flies, with the manners and the failsafes of the real thing: real client libraries take them for it.

What one does is decided without input and output, in a time that is passed on by whoever owns it; `tests.fakes.udp` puts it on
the network, in real time.
"""
