"""What holds a Crazyradio: a process per dongle, between the drones' processes and their Crazyflies.

The only package that knows cflib (GPL-3, the extra ``radio``); no other imports it, nor does it import any but ``protocols``.
"""
