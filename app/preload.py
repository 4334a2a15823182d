"""The process that working processes are forked from imports this, and nobody else does: they begin with what their work needs.

It leaves when nobody is left who could ask it for a process, and no signal ends it before: it alone can tell how a process ended.
"""

import gc
import os
import signal


def _ready() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.environ["OPENBLAS_NUM_THREADS"] = (
        "1"  # as everybody who works has it; threads are not forked
    )
    from handscope.app.replay_file import kept
    from handscope.app.report import html, pdf
    from handscope.app.results import make as results_make
    from handscope.app.results import report as results_report

    assert results_report and results_make and html and pdf and kept
    gc.freeze()  # what is never touched is never copied


_ready()
