"""Imported only by the process that worker processes are forked from, so that they start with what they need.

It ends when no process is left that could ask it for another; signals do not end it, since it alone can tell how a
process ended.
"""

import gc
import os
import signal


def _ready() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as in every worker; threads are not forked
    from handscope.app.workers.garbage import GARBAGE

    gc.set_threshold(*GARBAGE)  # as in every command
    from handscope.app.replay_file import stored
    from handscope.app.report import html, pdf
    from handscope.app.results import make as results_make
    from handscope.app.results import report as results_report
    from handscope.app.scene.mesh.hand_mesh import hand_mesh
    from handscope.estimators.hand.anatomy import HANDS
    from handscope.estimators.hand.geometry import sized
    from handscope.estimators.methods import ALL_METHODS
    from handscope.estimators.numerics.jit import load_kernels

    assert results_report and results_make and html and pdf and stored
    assert all(method.TITLE for method in ALL_METHODS.values())
    load_kernels()
    for hand in HANDS:
        hand_mesh(sized(hand))  # of average size: the scene's process would take half a second
    gc.freeze()  # pages that are never written are never copied


_ready()
