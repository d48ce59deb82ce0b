"""Downloads from a server of our own that breaks off, stalls, drips, changes its mind and has gaps."""

import hashlib
import json
import re
import threading
import time
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from capture.cmu_site import chosen, fetch_archive, fetch_index, fetch_motions, parse_index, read_motions
from capture.fetching import CHECKSUMS, Cache, Patience
from devices.errors import FileError, SettingError
from reconstruction.database import open_database
from tests.capture.conftest import entries

HURRIED = Patience(timeout_s=0.4, tries=3, pause_s=0.01)
CONTENT = bytes(range(256)) * 1200


@dataclass
class Site:
    """A web server. files: by path; each path may break off after so many bytes, once; stall then; drip; refuse."""

    files: dict[str, bytes] = field(default_factory=dict)
    breaks_at: dict[str, int] = field(default_factory=dict)
    stalls_at: dict[str, int] = field(default_factory=dict)
    drips: set[str] = field(default_factory=set)
    fails: dict[str, list[int]] = field(default_factory=dict)
    knows_ranges: bool = True
    asked: list[tuple[str, str | None]] = field(default_factory=list)
    address: str = ""

    def etag(self, path: str) -> str:
        return f'"{hashlib.md5(self.files[path]).hexdigest()}"'


@pytest.fixture
def site() -> Iterator[Site]:
    told = Site()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            told.asked.append((self.path, self.headers.get("Range")))
            if told.fails.get(self.path):
                self._answer(told.fails[self.path].pop(0), b"sorry")
            elif self.path not in told.files:
                self._answer(404, b"nothing here")
            else:
                self._send(told.files[self.path])

        def _send(self, content: bytes) -> None:
            wanted = re.match(r"bytes=(\d+)-$", self.headers.get("Range", ""))
            same = self.headers.get("If-Range") == told.etag(self.path)
            first = int(wanted[1]) if wanted and same and told.knows_ranges else 0
            self.send_response(206 if first else 200)
            self.send_header("Content-Length", str(len(content) - first))
            self.send_header("ETag", told.etag(self.path))
            self.end_headers()
            rest = content[first:]
            if self.path in told.breaks_at:
                self.wfile.write(rest[: told.breaks_at.pop(self.path)])
                self.close_connection = True
            elif self.path in told.stalls_at:
                self.wfile.write(rest[: told.stalls_at.pop(self.path)])
                self.wfile.flush()
                time.sleep(2 * HURRIED.timeout_s)
                self.close_connection = True
            elif self.path in told.drips:
                for at in range(0, len(rest), len(rest) // 4):
                    self.wfile.write(rest[at : at + len(rest) // 4])
                    self.wfile.flush()
                    time.sleep(HURRIED.timeout_s / 2)
            else:
                self.wfile.write(rest)

        def _answer(self, status: int, text: bytes) -> None:
            self.send_response(status)
            self.send_header("Content-Length", str(len(text)))
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, *_) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    told.address = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    yield told
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture
def cache(tmp_path) -> Iterator[Cache]:
    cache = Cache(tmp_path / "cache", HURRIED)
    yield cache
    cache.close()


def test_a_file_comes_once_and_is_checked(site, cache):
    site.files["/a.bin"] = CONTENT
    steps = []
    path = cache.fetch(f"{site.address}/a.bin", "a/b.bin", lambda done, total: steps.append((done, total)))
    assert path.read_bytes() == CONTENT
    assert steps[-1] == (300, 300)
    assert cache.checksums() == {"a/b.bin": hashlib.sha256(CONTENT).hexdigest()}
    assert cache.fetch(f"{site.address}/a.bin", "a/b.bin") == path
    assert len(site.asked) == 1
    assert entries(cache.folder / "a") == {"b.bin"}


def test_what_breaks_off_is_gone_on_with(site, cache):
    site.files["/a.bin"] = CONTENT
    site.breaks_at["/a.bin"] = 100_000
    assert cache.fetch(f"{site.address}/a.bin", "a.bin").read_bytes() == CONTENT
    assert site.asked == [("/a.bin", None), ("/a.bin", "bytes=65536-")]


def test_what_broke_off_is_gone_on_with_by_the_next_run(site, cache, tmp_path):
    site.files["/a.bin"] = CONTENT
    site.breaks_at["/a.bin"] = 150_000
    site.fails["/a.bin"] = []
    impatient = Cache(cache.folder, Patience(0.4, 1, 0.01))
    with pytest.raises(FileError, match=r"128 KiB have come: run it again to go on"):
        impatient.fetch(f"{site.address}/a.bin", "a.bin")
    impatient.close()
    assert not (cache.folder / "a.bin").exists()
    assert cache.fetch(f"{site.address}/a.bin", "a.bin").read_bytes() == CONTENT
    assert site.asked[-1] == ("/a.bin", "bytes=131072-")
    assert entries(cache.folder) == {"a.bin", CHECKSUMS}


def test_another_version_is_not_glued_to_the_old_beginning(site, cache):
    site.files["/a.bin"] = CONTENT
    site.breaks_at["/a.bin"] = 150_000
    impatient = Cache(cache.folder, Patience(0.4, 1, 0.01))
    with pytest.raises(FileError):
        impatient.fetch(f"{site.address}/a.bin", "a.bin")
    impatient.close()
    site.files["/a.bin"] = CONTENT[::-1]
    assert cache.fetch(f"{site.address}/a.bin", "a.bin").read_bytes() == CONTENT[::-1]


def test_a_server_without_ranges_sends_it_all_again(site, cache):
    site.files["/a.bin"], site.knows_ranges = CONTENT, False
    site.breaks_at["/a.bin"] = 100_000
    assert cache.fetch(f"{site.address}/a.bin", "a.bin").read_bytes() == CONTENT


def test_a_server_that_stalls_is_asked_again_and_a_slow_one_waited_for(site, cache):
    site.files["/a.bin"] = site.files["/slow.bin"] = CONTENT
    site.stalls_at["/a.bin"] = 70_000
    site.drips.add("/slow.bin")
    assert cache.fetch(f"{site.address}/a.bin", "a.bin").read_bytes() == CONTENT
    assert site.asked[-1][1] is not None
    before = len(site.asked)
    assert cache.fetch(f"{site.address}/slow.bin", "slow.bin").read_bytes() == CONTENT
    assert len(site.asked) == before + 1


def test_a_busy_server_is_asked_again_and_a_missing_file_is_not(site, cache):
    site.files["/a.bin"] = CONTENT
    site.fails["/a.bin"] = [503, 429]
    assert cache.fetch(f"{site.address}/a.bin", "a.bin").read_bytes() == CONTENT
    site.fails["/a.bin"] = [500, 500, 500]
    with pytest.raises(FileError, match="answers 500"):
        cache.fetch(f"{site.address}/a.bin", "b.bin")
    asked = len(site.asked)
    with pytest.raises(FileError, match=r"none\.bin: the server answers 404"):
        cache.fetch(f"{site.address}/none.bin", "none.bin")
    assert len(site.asked) == asked + 1


def test_what_the_disk_spoiled_comes_anew_and_what_the_server_changed_is_refused(site, cache):
    site.files["/a.bin"] = CONTENT
    path = cache.fetch(f"{site.address}/a.bin", "a.bin")
    path.write_bytes(CONTENT[:-1] + b"!")
    assert cache.fetch(f"{site.address}/a.bin", "a.bin").read_bytes() == CONTENT
    path.unlink()
    site.files["/a.bin"] = CONTENT[::-1]
    with pytest.raises(FileError, match="another file than the one fetched before"):
        cache.fetch(f"{site.address}/a.bin", "a.bin")
    assert entries(cache.folder) == {CHECKSUMS}
    (cache.folder / CHECKSUMS).write_text("no JSON")
    with pytest.raises(FileError, match="not a list of checksums"):
        cache.fetch(f"{site.address}/a.bin", "a.bin")


def test_a_server_that_is_not_there_is_one_line(cache):
    with pytest.raises(FileError, match="cannot be reached"):
        cache.fetch("http://127.0.0.1:9/a.bin", "a.bin")


INDEX = """<HTML><TABLE><TR><TH>Motion</TH><TH>Description</TH></TR>
<TR><TD>Subject #{subject} (someone)</TD><TD><A HREF="http://x:80/subjects/35/35.asf">asf</A></TD></TR>
<TR><TD></TD><TD>1</TD><TD>walk, &amp; turn</TD><TD><A HREF="http://x:80/subjects/35/35_01.tvd">tvd</A></TD>
<TD><A HREF="http://x:80/subjects/35/35_01.amc">amc</A></TD><TD><A HREF="x.mpg">mpg</A></TD><TD></TD><TD>120</TD>
<TD><A HREF="badtrial.php?subjectnumber=35&motion=1">Feedback</A></TD></TR>
<TD></TD><TD>2</TD><TD>run/jog</TD><TD><A HREF="http://x:80/subjects/35/35_02.amc">amc</A></TD><TD>60</TD>
<TR><TD></TD><TD>3</TD><TD>Unknown</TD><TD><A HREF="/subjects/127/127_03.amc">amc</A></TD><TD></TD></TR>
"""


def test_the_index_tells_what_is_done_and_how_fast_it_was_taken():
    motions = parse_index(INDEX)
    assert [(m.name, m.text, m.fps) for m in motions] == [
        ("35_01", "walk, & turn", 120), ("35_02", "run/jog", 60), ("127_03", "Unknown", 120),
    ]  # fmt: skip
    assert (motions[2].asf, motions[2].amc) == ("subjects/127/127.asf", "subjects/127/127_03.amc")
    assert [m.name for m in chosen(motions, ["RUN", "jog", "walk"])] == ["35_02", "35_01"]
    assert chosen(motions, []) == motions
    with pytest.raises(SettingError, match="no motion is described by 'alk'; there are turn, unknown, walk"):
        chosen(motions, ["alk"])


BONES = (
    ("lhipjoint", "root", (0.5, -0.5, 0)), ("lfemur", "lhipjoint", (0, -7, 0)), ("ltibia", "lfemur", (0, -7, 0)),
    ("lfoot", "ltibia", (0, 0, 2)), ("ltoes", "lfoot", (0, 0, 1)),
    ("rhipjoint", "root", (-0.5, -0.5, 0)), ("rfemur", "rhipjoint", (0, -7, 0)), ("rtibia", "rfemur", (0, -7, 0)),
    ("rfoot", "rtibia", (0, 0, 2)), ("rtoes", "rfoot", (0, 0, 1)),
    ("lowerback", "root", (0, 2, 0)), ("upperback", "lowerback", (0, 2, 0)), ("thorax", "upperback", (0, 2, 0)),
    ("lowerneck", "thorax", (0, 1, 0)), ("upperneck", "lowerneck", (0, 1, 0)), ("head", "upperneck", (0, 1, 0)),
    ("lclavicle", "thorax", (2, 0, 0)), ("lhumerus", "lclavicle", (5, 0, 0)), ("lradius", "lhumerus", (4, 0, 0)),
    ("lwrist", "lradius", (1, 0, 0)), ("lhand", "lwrist", (1, 0, 0)),
    ("rclavicle", "thorax", (-2, 0, 0)), ("rhumerus", "rclavicle", (-5, 0, 0)), ("rradius", "rhumerus", (-4, 0, 0)),
    ("rwrist", "rradius", (-1, 0, 0)), ("rhand", "rwrist", (-1, 0, 0)),
)  # fmt: skip


def acclaim(frames: int, bones=BONES) -> tuple[bytes, bytes]:
    """A person of CMU's joints who swings its left leg: ASF and AMC."""
    blocks, hierarchy = [], {}
    for number, (name, parent, way) in enumerate(bones, 1):
        length = sum(v * v for v in way) ** 0.5
        direction = " ".join(f"{v / length:.9f}" for v in way)
        blocks.append(f"begin\nid {number}\nname {name}\ndirection {direction}\nlength {length:.9f}\n"
                      "axis 0 0 0 XYZ\ndof rx ry rz\nlimits (-180 180)\n(-180 180)\n(-180 180)\nend\n")  # fmt: skip
        hierarchy.setdefault(parent, []).append(name)
    asf = (
        ":version 1.10\n:units\nmass 1.0\nlength 0.45\nangle deg\n:root\norder TX TY TZ RX RY RZ\naxis XYZ\n"
        f"position 0 0 0\norientation 0 0 0\n:bonedata\n{''.join(blocks)}:hierarchy\nbegin\n"
        + "".join(f"{parent} {' '.join(names)}\n" for parent, names in hierarchy.items())
        + "end\n"
    )
    lines = [":FULLY-SPECIFIED\n:DEGREES\n"]
    for frame in range(frames):
        lines.append(f"{frame + 1}\nroot {0.1 * frame:.3f} 16 0 0 0 0\n")
        lines += [f"{name} {20 * (name == 'lfemur') * ((frame % 40) / 40 - 0.5):.3f} 0 0\n" for name, _, _ in bones]
    return asf.encode(), "".join(lines).encode()


@pytest.fixture
def mocap(site) -> Site:
    """A server with CMU's addresses: three motions, of which one is missing."""
    asf, walk = acclaim(90)
    site.files |= {
        "/search.php?subjectnumber=%25&motion=%25": INDEX.encode(),
        "/subjects/35/35.asf": asf,
        "/subjects/35/35_01.amc": walk,
        "/subjects/35/35_02.amc": acclaim(60)[1],
    }
    return site


def test_motions_of_an_action_become_a_database(run, mocap, tmp_path):
    words = ("database", "fetch", "cmu", "--site", mocap.address, "--cache", tmp_path / "cache", "--json")
    mocap.breaks_at["/subjects/35/35_01.amc"] = 3_000
    status, out, error = run(*words, "--actions", "walk,run", "--out", tmp_path / "db")
    assert status == 0, error
    assert "may not be resold" in error
    told = json.loads(out)
    assert (told["motions"], told["left_out"]) == (2, [])
    database = open_database(tmp_path / "db")
    # 90 frames at 120 a second, and 60 at 60, both at 60.
    assert [clip.frames for clip in database.clips] == [45, 60]
    asked = len(mocap.asked)
    assert run(*words, "--actions", "walk", "--out", tmp_path / "other")[0] == 0
    assert len(mocap.asked) == asked


def test_everything_comes_as_one_archive_and_what_it_lacks_alone(run, mocap, tmp_path):
    with zipfile.ZipFile(tmp_path / "all.zip", "w", zipfile.ZIP_DEFLATED) as packed:
        for name in ("/subjects/35/35.asf", "/subjects/35/35_01.amc"):
            packed.writestr(f"all_asfamc{name}", mocap.files[name])
        packed.writestr("all_asfamc/../../evil.amc", b"no")
    mocap.files["/allasfamc.zip"] = (tmp_path / "all.zip").read_bytes()
    mocap.breaks_at["/allasfamc.zip"] = 500
    words = ("--site", mocap.address, "--cache", tmp_path / "cache", "--out", tmp_path / "db", "--json")
    status, out, error = run("database", "fetch", "cmu", *words)
    assert status == 0, error
    told = json.loads(out)
    assert told["motions"] == 2
    assert any("127_03.amc: the server answers 404" in line for line in told["left_out"])
    assert ("/subjects/35/35_01.amc", None) not in mocap.asked
    assert ("/subjects/35/35_02.amc", None) in mocap.asked
    assert "evil.amc" not in {path.name for path in tmp_path.rglob("*")}


def test_the_motions_there_are_can_be_listed(run, mocap, tmp_path):
    words = ("database", "fetch", "cmu", "--site", mocap.address, "--cache", tmp_path / "cache", "--list")
    status, out, _ = run(*words)
    assert status == 0
    assert "35_02      60 Hz  run/jog" in out
    assert len(mocap.asked) == 1


def test_what_is_broken_is_left_out_and_told(mocap, cache):
    motions = fetch_index(cache, mocap.address)
    mocap.files["/subjects/35/35_02.amc"] = b"1\nroot 1 2\n"
    mocap.files["/subjects/127/127.asf"], mocap.files["/subjects/127/127_03.amc"] = acclaim(10, BONES[:-1])
    assert list(fetch_motions(motions, cache, mocap.address)) == []
    left_out: list[str] = []
    assert [motion.name for motion in read_motions(motions, cache.folder, left_out)] == ["35_01"]
    assert "35_02.amc" in left_out[0]
    assert left_out[1] == "127_03: its skeleton has other joints than the first one's"


def test_a_page_without_motions_and_a_broken_archive_are_said_so(site, cache):
    site.files["/search.php?subjectnumber=%25&motion=%25"] = b"<html>We moved</html>"
    with pytest.raises(FileError, match="no motions are listed"):
        fetch_index(cache, site.address)
    site.files["/allasfamc.zip"] = b"PK no zip"
    with pytest.raises(FileError, match="delete it to fetch it anew"):
        fetch_archive(cache, site.address)


@pytest.mark.parametrize(
    ("words", "message"),
    [(("bandai",), "cmu"), (("cmu", "--out", "a_file/db"), "is a file"), (("cmu", "--actions", "fly"), "described")],
)
def test_wrong_words_are_one_line(run, mocap, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    Path("a_file").touch()
    status, _, error = run("database", "fetch", *words, "--site", mocap.address, "--cache", Path("cache"))
    assert status == 2
    assert message in error.strip().splitlines()[-1]
