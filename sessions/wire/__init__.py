"""The glove's wire protocol without I/O: `messages` (values and their bytes), `framing` (bytes cut anywhere), `assembly` (messages to blocks).

It lives with the recordings because a native recording is the bytes of the wire. docs/wire-protocol.md describes it for firmware writers.
"""
