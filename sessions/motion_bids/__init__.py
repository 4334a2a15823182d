"""Motion-BIDS in and out: the contract with other programs (docs/motion-bids.md)."""

from sessions.motion_bids.reader import load as load
from sessions.motion_bids.writer import write as write
