"""Motion-BIDS in and out: the contract with other programs (docs/motion-bids.md)."""

from handscope.sessions.motion_bids.reader import load as load
from handscope.sessions.motion_bids.writer import write as write
