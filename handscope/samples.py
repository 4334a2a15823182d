"""Small simulated recordings with their truth: `hs.load(hs.samples.make("tapping_fast"))` (docs/measures.md)."""

from handscope.app.analysis.samples import SAMPLES as SAMPLES
from handscope.app.analysis.samples import make as make
