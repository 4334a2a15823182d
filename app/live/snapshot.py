"""What a page is told about a live station: plain data, clinical words, degrees and millimetres."""

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from handscope.app.live.readouts.angle_rows import told_angles
from handscope.app.live.wizard import machine as wz
from handscope.app.live.wizard.machine import Facts, State, Wizard
from handscope.app.protocols import Protocol
from handscope.estimators.alignment.functional_movements import Piece
from handscope.estimators.alignment.quality import JointQuality
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import FORCE
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.measures import repetitions, tapping

if TYPE_CHECKING:
    from handscope.app.live.station import Station

SPOILT = ("This step cannot be used", "Repeat it, or leave it out and go on.")
STOPPED = (
    "Nothing more is recorded",
    "What was recorded and accepted until then is kept; the trial that ran is not. End the session.",
)
PASSIVE = (
    "Initial pose, given by you",
    "Lay the patient's hand as the blue hand shows: flat, fingers straight and together, thumb out sideways. Hold it on the table, then start.",
)
RESUMABLE = {
    "anywhere": (
        "Paused",
        "Go on when the patient is ready: the trial goes on where it stopped, and the pause does not count.",
    ),
    "phase": (
        "Paused",
        "Go on when the patient is ready: “{word}” is done once more, and the pause does not count.",
    ),
    "repetition": (
        "Paused",
        "Go on when the patient is ready: movement {number} of {all} is done once more, and the pause does not count.",
    ),
}
CLOSING = (
    "Initial pose again",
    "Lay the hand flat once more as the blue hand shows. With this pose what the movements told comes into force.",
)
SCALES = {"repetitions": 1.0} | dict.fromkeys(
    ("rate_wander", "tilt_change", "repeatability", "extent"), 180 / np.pi
)  # shares: per cent
DIGITS = {"rate_wander": 2, "tilt_change": 1}
UNCOUNTED = (
    "reach",
    "force",
)  # groups of tasks in which closing the fingers is no tap and no repetition
LEAST = 8.0  # deg: a curve that goes less far shows no repetition
STEPS = (("connect", "Connect"), ("pose", "Initial pose"), ("tasks", "Tasks"), ("finish", "Finish"))
STEP_OF = {
    State.CONNECT: "connect",
    State.CHECK: "connect",
    State.CHECKED: "connect",
    State.FINISHED: "finish",
} | dict.fromkeys(
    (
        State.POSE_READY,
        State.POSE_HOLD,
        State.POSE_WORK,
        State.POSE_REVIEW,
        *wz.STEPPING,
        *wz.MOVING_FREELY,
    ),
    "pose",
)
WORDS = {
    State.CONNECT: (
        "Put the glove on",
        "Bend one finger after the other: the finger that moves must light up.",
    ),
    State.CHECKED: ("Sensors checked", "Every finger's own strip should have moved. Then go on."),
    State.POSE_READY: (
        "Initial pose",
        "Lay the hand flat, fingers straight and together, thumb stretched out sideways as the blue hand shows. Then start.",
    ),
    State.POSE_HOLD: ("Hold still", "Keep the hand exactly like this until the bar is full."),
    State.POSE_WORK: ("One moment", "The calibration is being computed."),
    State.POSE_REVIEW: (
        "Does the hand look right?",
        "The 3-D hand should lie as the patient's hand does. If not, do the pose again.",
    ),
    State.TASKS: ("Choose a task", "Do the tasks in order, or only those you need."),
    State.TASK_PAUSED: (
        "Paused",
        "This trial cannot go on after a pause: its rhythm and its length are what is measured. Start it again when the patient is ready, or keep what was done.",
    ),
    State.TASK_REVIEW: (
        "Keep this one?",
        "Accept what was recorded, do it again, or skip the task with a reason.",
    ),
    State.STEP_REVIEW: (
        "This step is good",
        "Go on, or repeat it if the patient did something else.",
    ),
    State.FREE_WORK: (
        "One moment",
        "The hand is being calibrated from its movement; the hand may rest. This takes a minute or two.",
    ),
    State.FREE_REVIEW: (
        "Use what was found?",
        "Lengths and how the sensors sit serve this session, and are kept with the patient. After the glove was taken off only the lengths hold.",
    ),
    State.FINISHED: ("Finished", "The recording is closed. The results are being computed."),
}


def tell(
    station: "Station", wizard: Wizard, facts: Facts, calibration: Calibration | None, problem: str
) -> dict[str, Any]:
    """The whole snapshot."""
    return {
        "station": station.name,
        "session": station.setup.session,
        "hand": station.setup.hand,
        "wizard": told_of(wizard, facts),
        "glove": _glove(station, facts, problem),
        "calibration": _calibration(calibration, station.joints()),
        "step_quality": _quality(station.steps.piece(wizard.task))
        if wizard.state is State.STEP_REVIEW
        else None,
        "self_calibration": station.free.told() if wizard.state in wz.MOVING_FREELY else None,
        "curve": {
            "title": station.curve.title,
            "unit": station.curve.unit,
            "what": station.curve.what,
        },
        "sensor_faults": station.faults if wizard.state is State.CHECKED else [],
        "protocol_faults": [{"reason": fault} for fault in station.setup.faults],
        "numbers": _numbers(station, wizard, facts),
        "place": station.whereabouts.told(),
        "ended": station.ended,
    }


def beat(station: "Station", since: float) -> dict[str, Any]:
    """The light message that follows every pose."""
    return {
        "angles": _angles(station),
        "points": station.curve.since(since),
        "what": station.curve.what,
        "row_age_ms": _row_age(station),
        "told": time.monotonic(),
    }


def told_of(w: Wizard, facts: Facts) -> dict[str, Any]:
    """Where the wizard stands: what to say, what can be done, which tasks there are, and what the metronome goes by."""
    protocol = w.protocol
    in_task = w.state in (
        State.TASK_READY,
        *wz.COUNTING,
        *wz.RUNNING,
        State.STEP_READY,
        State.FREE_READY,
    )
    title, words = (
        (protocol.title, protocol.instruction)
        if in_task and protocol and facts.kept
        else _words(w, facts)
    )
    steps = [p.name for p in w.steps_offered(facts)] if w.state in wz.STEPPING else []
    if in_task and w.task in steps and facts.kept:
        title = f"Step {steps.index(w.task) + 1} of {len(steps)}: {title}"
    return {
        "state": w.state,
        "step": STEP_OF.get(w.state, "tasks"),
        "steps": [{"name": name, "title": text} for name, text in STEPS],
        "title": title,
        "instruction": words,
        "message": w.message,
        "proposal": w.proposal(facts),
        "check": _check(w, facts),
        "passive": w.passive,
        "actions": w.allowed(facts),
        "progress": round(wz.progress(w, facts), 3),
        "remaining": None if (left := wz.remaining(w, facts)) is None else round(left, 2),
        "still": facts.wander <= wz.STILL_RATE,
        "restless": facts.restless,
        "task": w.task,
        "tasks": [_task(w, p) for p in w.listed(facts)],
        "group": w.group,
        "groups": [_group(w, name, tasks) for name, tasks in w.groups(facts).items()],
        "calibration_steps": [_step(w, p) for p in w.steps_offered(facts)]
        if w.state in wz.STEPPING
        else [],
        "score": _score(protocol) if w.state is State.TASK_REVIEW and protocol else None,
        "pace": _pace(w, protocol, facts) if in_task and protocol else None,
    }


def _words(w: Wizard, facts: Facts) -> tuple[str, str]:
    """Title and sentence of a state that is no task's."""
    if not facts.kept and w.state is not State.FINISHED:
        return STOPPED
    if w.state is State.STEP_REVIEW and (judged := w.judgement(w.task)) and judged.problems:
        return SPOILT
    if w.state is State.CHECK and (finger := w.asked(facts)):
        name = finger if finger == "thumb" else f"{finger} finger"
        return (
            f"Bend the {name}",
            "Only this one, to and fro, then keep still. The page goes on by itself when a strip moves.",
        )
    if w.state is State.POSE_READY and w.closing:
        return CLOSING
    if w.state is State.POSE_READY and w.passive:
        return PASSIVE
    if w.state is State.TASK_PAUSED and w.protocol and w.protocol.resumes:
        return _resumable(w, w.protocol)
    return WORDS.get(w.state, ("", ""))


def _resumable(w: Wizard, p: Protocol) -> tuple[str, str]:
    """What a paused trial goes on with."""
    title, words = RESUMABLE[p.resumes or "anywhere"]
    found = p.at(wz.resumed_at(w))
    return title, words.format(
        word=found[0].say, number=found[1], all=p.repetitions
    ) if found else words


def _step(w: Wizard, p: Protocol) -> dict[str, Any]:
    """A step of the calibration and what became of it: good, spoilt, used (in an earlier calibration), or nothing yet."""
    judged = w.judgement(p.name)
    outcome = (
        ("spoilt" if judged.problems else "good") if judged else "used" if p.name in w.used else ""
    )
    return {"name": p.name, "title": p.title, "outcome": outcome}


def _quality(piece: Piece | None) -> dict[str, float] | None:
    """What a step is judged by, for people: degrees, degrees per second, shares in per cent."""
    if piece is None:
        return None
    return {
        name: round(value * SCALES.get(name, 100.0), DIGITS.get(name, 0))
        for name, value in piece.quality.items()
    }


def _check(w: Wizard, facts: Facts) -> dict[str, Any] | None:
    """The sensor check: which finger is asked for, whose strip moved for each, what can be exchanged."""
    if w.state not in (State.CONNECT, State.CHECK, State.CHECKED, State.POSE_REVIEW):
        return None
    return {
        "fingers": w.checkable(facts),
        "asked": w.asked(facts),
        "calm": w.calm,
        "moved": dict(w.seen) if w.state in (State.CHECK, State.CHECKED) else {},
        "exchange": [
            {"strip": strip, "finger": finger} for strip, finger in w.exchangeable().items()
        ],
    }


def _score(p: Protocol) -> dict[str, Any] | None:
    """What the clinician may say of the trial under review by eye."""
    return (
        None
        if p.score is None
        else {
            "title": p.score.title,
            "least": p.score.least,
            "most": p.score.most,
            "hint": p.score.hint,
        }
    )


def _task(w: Wizard, p: Protocol) -> dict[str, Any]:
    return {
        "name": p.name,
        "title": p.title,
        "outcome": w.outcome(p.name),
        "duration": p.length,
        "trials": p.trials,
        "accepted": w.accepted(p.name),
    }


def _group(w: Wizard, name: str, tasks: list[Protocol]) -> dict[str, Any]:
    return {
        "name": name,
        "title": name.replace("_", " ").capitalize(),
        "tasks": len(tasks),
        "done": sum(bool(w.outcome(p.name)) for p in tasks),
    }


def _pace(w: Wizard, p: Protocol, facts: Facts) -> dict[str, Any]:
    """What the metronome and the counter of repetitions go by; `elapsed` counts what was done of the trial and is None before it
    runs; after a pause it goes on from `begins`, s."""
    return {
        "cycle": [{"say": phase.say, "seconds": phase.seconds} for phase in p.cycle],
        "repetitions": p.repetitions,
        "trial": w.accepted(p.name) + 1,
        "trials": p.trials,
        "begins": round(wz.resumed_at(w), 3) if w.state is State.RESUME_COUNTDOWN else 0.0,
        "elapsed": round(wz.done(w, facts.t), 3) if w.state in wz.RUNNING else None,
    }


def _glove(station: "Station", facts: Facts, problem: str) -> dict[str, Any]:
    glove = station.glove
    a = glove.assembler
    return {
        "state": glove.state.state,
        "reason": glove.state.reason,
        "problem": problem,
        "flowing": facts.flowing,
        "name": a.identity.name if a.identity else None,
        "firmware": a.identity.firmware if a.identity else None,
        "battery": a.status.battery_percent if a.status else None,
        "strips": _strips(station),
        "forces": _forces(station),
        "measured": [s for s in SEGMENTS if s in facts.measured],
        "frames_lost": a.counters.lost,
        "frames_corrupt": a.counters.corrupt,
        "overruns": a.status.overruns if a.status else 0,
        "dropped_live": glove.state.dropped + station.tracking.skipped,
        "method_failures": station.tracking.failures,
        "decoding_failures": glove.decoding_failures,
        "recorded": round(facts.t, 1) if np.isfinite(facts.t) else 0.0,
        "row_age_ms": _row_age(station),
        "told": time.time(),
    }


def _row_age(station: "Station") -> float | None:
    """How old the newest pose is, sampled to now, in ms."""
    now = station.glove.now()
    return (
        None
        if station.latest is None or now is None
        else round(1e3 * (now - float(station.latest.t[-1])), 1)
    )


def _strips(station: "Station") -> list[dict[str, Any]]:
    a = station.glove.assembler
    told = []
    for number, stream in sorted(a.streams.items()):
        count = a.counts.get(stream.name)
        lost, saturated, samples = (
            (count.lost, count.saturated, count.samples) if count else (0, 0, 0)
        )
        told.append(
            {
                "stream": number,
                "name": stream.name,
                "sensors": len(stream.sensors),
                "rate": stream.rate,
                "samples": samples,
                "lost": lost,
                "saturated": saturated,
            }
        )
    return told


def _forces(station: "Station") -> list[dict[str, Any]]:
    """Fingers whose tips have a force sensor, and to what share of itself a force is known where that was calibrated."""
    felt = [
        (s, point)
        for _, s in sorted(station.glove.assembler.streams.items())
        if FORCE in s.quantities
        for point in s.sensors
    ]
    known = [(point.removesuffix("_tip_force"), s.scale_sd.get(point)) for s, point in felt]
    return [
        {"finger": finger, "percent": None if share is None else float(f"{100 * share:.2g}")}
        for finger, share in known
    ]


def _calibration(c: Calibration | None, joints: list[JointQuality]) -> dict[str, Any] | None:
    if c is None:
        return None
    told: dict[str, Any] = {
        "source": c.source,
        "steps": len(c.steps),
        "warnings": list(c.warnings),
        "joints": [_joint(j) for j in joints],
    }
    if c.quality:
        worst = max(c.quality, key=lambda s: c.quality[s].rate_wander)
        tilted = max(c.quality, key=lambda s: c.quality[s].misalignment)
        told |= {
            "stillness_deg_s": round(float(np.degrees(c.quality[worst].rate_wander)), 2),
            "least_still": worst,
            "misalignment_deg": round(float(np.degrees(c.quality[tilted].misalignment)), 1),
            "most_misaligned": tilted,
        }
    return told


def _joint(j: JointQuality) -> dict[str, Any]:
    return {
        "joint": j.joint,
        "grade": j.grade,
        "reason": j.reason,
        "segment": j.segment,
        "deg": round(float(np.degrees(j.value)), 1),
    }


def _angles(station: "Station") -> list[dict[str, Any]]:
    return [] if station.latest is None else told_angles(station.latest.angles[-1])


def _numbers(station: "Station", w: Wizard, facts: Facts) -> list[dict[str, Any]]:
    """Live numbers of the task or flexion that runs or was just done."""
    if (
        w.state not in (*wz.RUNNING, State.TASK_PAUSED, State.TASK_REVIEW, State.STEP_REVIEW)
        or w.protocol is None
    ):
        return []
    if w.state is State.FREE_RUN or (
        w.state in wz.STEPPING and not w.protocol.cycle
    ):  # the meter tells, or nothing bends
        return []
    points = station.curve.attempted()
    if len(points) < 3:
        return []
    t, values = np.array(points).T
    told = [
        ("largest", float(values.max()), station.curve.unit),
        ("smallest", float(values.min()), station.curve.unit),
    ]
    if w.protocol.group in UNCOUNTED:
        first = (
            station.whereabouts.number()
            if w.protocol.group == "reach"
            else station.held.told(w.task)
        )
        return [*([first] if first else []), *_rounded(told)]
    if station.curve.what == "aperture":
        told.insert(
            0,
            (
                "taps",
                float(max(0, len(tapping.closings(tapping.Params(), t, values * 1e-3)) - 1)),
                "",
            ),
        )
    else:
        told.insert(0, ("repetitions", float(repetitions.count(values, LEAST)), ""))
    return _rounded(told)


def _rounded(told: list[tuple[str, float, str]]) -> list[dict[str, Any]]:
    return [{"name": name, "value": round(value, 1), "unit": unit} for name, value, unit in told]
