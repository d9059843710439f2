"""Reads what is published with other people's packages, and prints what they say as JSON.

Usage: wire_readers.py check READER        ends with 0 if its packages are there
       wire_readers.py asterix-decoder|libasterix|pyasteryx FILE     blocks of category 062, one after the other
       wire_readers.py takproto FILE       XML events, a NUL between them
       wire_readers.py pytak PORT N        takes a connection and reads N events as a TAK client does
asterix-decoder and libasterix are two packages of one name (`asterix`): each lies in a folder of its own, WIRE_READERS/asterix-decoder and WIRE_READERS/libasterix.
"""

import asyncio
import json
import os
import sys
import warnings

warnings.simplefilter("ignore")
# One sensor, tentative, last and first message, coasting.
FLAGS = ("MON", "CNF", "TSE", "TSB", "CST")
READER = sys.argv[2] if sys.argv[1] == "check" else sys.argv[1]
if READER in ("asterix-decoder", "libasterix"):
    sys.path.insert(0, os.path.join(os.environ.get("WIRE_READERS", ""), READER))


def load():
    if READER == "asterix-decoder":
        import asterix

        return asterix if hasattr(asterix, "parse") else sys.exit(1)
    if READER == "libasterix":
        import asterix.base
        import asterix.generated

        return asterix
    if READER == "pyasteryx":
        import pyasteryx

        return pyasteryx
    if READER == "takproto":
        import takproto

        return takproto
    import pytak

    return pytak


def by_asterix_decoder(asterix, data):
    out = []
    for r in asterix.parse(data, verbose=False):

        def value(*names, r=r):
            at = r
            for name in names:
                at = at.get(name) if at is not None else None
            return at and at["val"]

        out.append(
            {
                "sac": value("I010", "SAC"),
                "sic": value("I010", "SIC"),
                "tod": value("I070", "ToT"),
                "lat": value("I105", "Lat"),
                "lon": value("I105", "Lon"),
                "vx": value("I185", "Vx"),
                "vy": value("I185", "Vy"),
                "number": value("I040", "TrkN"),
                "altitude_ft": value("I130", "Alt"),
                "flags": {name: value("I080", name) or 0 for name in FLAGS},
                "sds": [
                    value("I500", "APW", "APW_Lat"),
                    value("I500", "APW", "APW_Long"),
                    value("I500", "AGA", "AGA_Acc"),
                    value("I500", "ATV", "ATV_X"),
                    value("I500", "ATV", "ATV_Y"),
                ],
            }
        )
    return out


def by_libasterix(asterix, data):
    from asterix.base import Bits, RawDatablock

    spec = asterix.generated.Cat_062_1_18
    out = []
    for block in RawDatablock.parse(Bits.from_bytes(data)):
        assert block.get_category() == 62
        for r in spec.cv_uap.parse(block.get_raw_records()):

            def item(number, *names, r=r):
                at = r.get_item(number)
                for name in names:
                    at = at.variation.get_item(name) if at is not None else None
                return at

            def quantity(*where, item=item):
                at = item(*where)
                return at and at.variation.content.as_quantity()

            def flag(name, item=item):
                at = item("080", name)
                return at.as_uint() if at is not None else 0

            out.append(
                {
                    "sac": item("010", "SAC").as_uint(),
                    "sic": item("010", "SIC").as_uint(),
                    "tod": quantity("070"),
                    "lat": quantity("105", "LAT"),
                    "lon": quantity("105", "LON"),
                    "vx": quantity("185", "VX"),
                    "vy": quantity("185", "VY"),
                    "number": item("040").as_uint(),
                    "altitude_ft": quantity("130"),
                    "flags": {name: flag(name) for name in FLAGS},
                    "sds": [
                        quantity("500", "APW", "LAT"),
                        quantity("500", "APW", "LON"),
                        quantity("500", "AGA"),
                        quantity("500", "ATV", "X"),
                        quantity("500", "ATV", "Y"),
                    ],
                }
            )
    return out


def by_pyasteryx(pyasteryx, data):
    from pyasteryx.track import Track

    out = []
    for message in pyasteryx.Decoder().decode(data):
        t = Track(message)
        flags = [t.is_monosensor, not t.is_confirmed, t.is_last_report, t.is_first_report, t.is_coasting]
        out.append(
            {
                "sac": t.sac,
                "sic": t.sic,
                "tod": t.time_of_track,
                "lat": t.latitude,
                "lon": t.longitude,
                "vx": t.velocity_ms[0],
                "vy": t.velocity_ms[1],
                "number": t.track_number,
                "altitude_ft": t.geometric_altitude_ft,
                "flags": dict(zip(FLAGS, (int(bool(f)) for f in flags))),
            }
        )
    return out


def event(e):
    """A TAK message's event."""
    return {
        "uid": e.uid,
        "type": e.type,
        "how": e.how,
        "lat": e.lat,
        "lon": e.lon,
        "hae": e.hae,
        "ce": e.ce,
        "le": e.le,
        "start_ms": e.startTime,
        "send_ms": e.sendTime,
        "stale_ms": e.staleTime,
        "callsign": e.detail.contact.callsign,
        "speed": e.detail.track.speed,
        "course": e.detail.track.course,
        "rest": e.detail.xmlDetail,
    }


def by_takproto(takproto, data):
    out = []
    for xml in data.decode().split("\0"):
        if xml:
            out.append(event(takproto.parse_proto(takproto.xml2proto(xml)).cotEvent))
    return out


async def by_pytak(pytak, port, n):
    import takproto

    class Reader(pytak.RXWorker):
        async def handle_data(self, data):
            pass

    taken = asyncio.get_running_loop().create_future()
    server = await asyncio.start_server(lambda r, w: taken.set_result((r, w)), "127.0.0.1", port)
    print("listening", flush=True)
    reader, writer = await taken
    worker = Reader(asyncio.Queue(), {}, reader)
    out = []
    for _ in range(n):
        out.append(event(takproto.parse_proto(takproto.xml2proto((await worker.readcot()).decode())).cotEvent))
    writer.close()
    server.close()
    return out


package = load()
if sys.argv[1] == "check":
    sys.exit(0)
if READER == "pytak":
    found = asyncio.run(by_pytak(package, int(sys.argv[2]), int(sys.argv[3])))
else:
    with open(sys.argv[2], "rb") as file:
        data = file.read()
    by = {
        "asterix-decoder": by_asterix_decoder,
        "libasterix": by_libasterix,
        "pyasteryx": by_pyasteryx,
        "takproto": by_takproto,
    }
    found = by[READER](package, data)
print(json.dumps(found))
