"""States the columns of each table format: NASA's DAIDALUS, trajectory tables, and plain CSV."""

from __future__ import annotations

from testbed.encounters.state_table import Column

_TIME = ("time", "t", "tm", "st", "clock")
_NAMES = ("name", "aircraft", "vehicle", "id", "ac", "callsign")
_NORTH = (
    "say which column is east and which north, as in east_ft and north_ft; in these tools' tracks x is north"
)
_ENCOUNTER = Column(("encounter", "encounter_id", "enc", "sample"), "word")

# Names and units as NASA's reader of state files takes them (SequenceReader); its times have one column.
DAA = {
    "aircraft": Column(("name", "aircraft", "id"), "word"),
    "t": Column(("time", "clock", "tm", "st"), "time", "s"),
    "latitude": Column(("lat", "latitude"), "angle", "deg"),
    "longitude": Column(("lon", "long", "longitude"), "angle", "deg"),
    "x": Column(("sx",), "length", "nmi"),
    "y": Column(("sy",), "length", "nmi"),
    "z": Column(("alt", "altitude", "sz"), "length", "ft"),
    "track": Column(("trk", "track"), "angle", "deg"),
    "speed": Column(("gs", "groundspeed", "groundspd"), "speed", "knot"),
    "east_speed": Column(("vx",), "speed", "knot"),
    "north_speed": Column(("vy",), "speed", "knot"),
    "climb": Column(("vs", "vz", "verticalspeed", "hdot"), "speed", "fpm"),
}
# No unit is taken for granted: tools of one laboratory write feet, knots, and metres.
TABLE = {
    "encounter": _ENCOUNTER,
    "aircraft": Column(_NAMES, "word"),
    "t": Column(_TIME, "time"),
    "latitude": Column(("lat", "latitude"), "angle"),
    "longitude": Column(("lon", "longitude"), "angle"),
    "x": Column(("east", "x_east", "xeast", "yeast"), "length", hint=_NORTH),
    "y": Column(("north", "y_north", "ynorth", "xnorth"), "length", hint=_NORTH),
    "z": Column(("altitude", "alt", "up", "z", "height"), "length"),
    "track": Column(("track", "trk", "heading", "psi"), "angle"),
    "speed": Column(("groundspeed", "ground_speed", "gs", "speed"), "speed"),
    "climb": Column(("vertical_rate", "verticalrate", "vertrate", "vs", "hdot", "climb_rate"), "speed"),
}
CSV = {
    "encounter": _ENCOUNTER,
    "aircraft": Column(("vehicle", "aircraft", "name", "id"), "word"),
    "t": Column(("t", "time"), "time"),
    "x": Column(("x", "east"), "length"),
    "y": Column(("y", "north"), "length"),
    "z": Column(("z", "height", "up"), "length"),
    "course": Column(("course", "theta"), "angle"),
    "speed": Column(("v", "speed"), "speed"),
    "climb": Column(("zeta", "climb_rate"), "speed"),
}
# Format -> its columns, and lists of columns of each of which a file has one.
TABLES = {
    "daa": (DAA, (("aircraft",), ("t",), ("latitude", "x"), ("longitude", "y"), ("z",))),
    "table": (TABLE, (("t",), ("x", "latitude"), ("y", "longitude"), ("z",))),
    "csv": (CSV, (("aircraft",), ("t",), ("x",), ("y",))),
}
