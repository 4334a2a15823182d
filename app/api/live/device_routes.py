"""/api/devices: gloves that can be reached now, and those that measured here before"""

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter

from handscope.app.api.stations import list_gloves
from handscope.app.auth.roles import CLINICIAN, requires_role
from handscope.app.live.station import Station
from handscope.app.state import Db, LanguageDep, PartsDep
from handscope.sessions.gloves.known_gloves import known_gloves
from handscope.sessions.store import records

router = APIRouter(tags=["stations"], dependencies=[requires_role(CLINICIAN)])
SHOWN = ("name", "firmware", "battery", "flowing", "strips", "problem", "frames_lost")


@router.get("/devices")
def list_devices(db: Db, parts: PartsDep, language: LanguageDep) -> dict[str, Any]:
    """`reachable`: ports with what a running session shows of the glove there; `known`: gloves of recordings, the one worn last first."""
    running = {s.setup.port: s for s in parts.stations.all() if isinstance(s, Station)}
    seen = records.visible_among(db, {s.setup.session for s in running.values()})
    reachable = []
    for glove in list_gloves(parts, language):
        station = running.get(str(glove["path"]))
        shown = station is not None and station.setup.session in seen
        live = station.snapshot()["glove"] if station and shown else {}
        reachable.append({**glove, "live": {k: live[k] for k in SHOWN} if live else None})
    return {"reachable": reachable, "known": [asdict(glove) for glove in known_gloves(db)]}
