"""MAVLink: the dialect, codecs between values and messages, asyncio transports."""
