"""What a live session sends to other programs: poses by web socket, LSL and OSC (docs/live-stream.md)."""
