"""From a folder to what changed: with a worker killed in the middle, broken files, an object store, and a second run."""

from __future__ import annotations

import os
import shutil
import signal
import threading
import time
from pathlib import Path

import pytest

from scara_ident.fleet import Settings, watch_fleet
from scara_ident.fleet.table import COLUMNS, fleet_table
from scara_ident.recording.recording import write_recording
from scara_ident.robot.robot import load_robot
from tests.fleet.made import DATES, WORN, run_of

pytestmark = pytest.mark.slow

# Seconds after which another process hangs.
PATIENCE = 300.0


def state(folder: Path) -> dict[str, tuple[int, bytes]]:
    return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.rglob("*") if path.is_file()}


def kill_one(cluster: object, cache: Path, done: list[int]) -> None:
    """Kill a worker process of a cluster as soon as something of the work is done."""
    end = time.monotonic() + PATIENCE
    while not list(cache.glob("*.npz")) and time.monotonic() < end:
        time.sleep(0.01)
    victim = next(iter(cluster.workers.values())).pid
    os.kill(victim, signal.SIGKILL)
    done.append(victim)


@pytest.fixture(scope="module")
def broken(folder: Path, tmp_path_factory) -> Path:
    """The fleet with a file cut off, one given twice, one that leads nowhere and an arm without any."""
    place = tmp_path_factory.mktemp("broken") / "fleet"
    shutil.copytree(folder, place)
    cut = place / "arm1" / DATES[2] / "OJD_1.parquet"
    cut.write_bytes(cut.read_bytes()[:5000])
    shutil.copy(place / "arm3" / DATES[0] / "OJD_1.parquet", place / "arm3" / DATES[1] / "copy_1.parquet")
    (place / "arm4" / DATES[0] / "lost_2.parquet").symlink_to(place / "nowhere.parquet")
    (place / "arm5").mkdir()
    return place


@pytest.fixture(scope="module")
def first(cluster, broken, tmp_path_factory):
    output, killed = tmp_path_factory.mktemp("results"), []
    other = threading.Thread(target=kill_one, args=(cluster, output / "cache", killed), daemon=True)
    other.start()
    found = watch_fleet(str(broken), load_robot(), output, Settings(scheduler=cluster.scheduler_address))
    other.join()
    assert killed
    return output, found


def test_the_rest_is_complete_and_the_faults_are_listed(first):
    _, found = first
    table = fleet_table(found)
    assert table.columns == list(COLUMNS)
    each = table.filter(table["fault"].is_null()).group_by("arm", "date").len()
    assert len(each) == 4 * len(DATES) - 1
    assert each["len"].n_unique() == 1
    said = {report.arm: "; ".join(report.sentences) or None for report in found.arms}
    assert dict(table.select("arm", "changes").rows()) == said and said[WORN]
    told = table["fault"].drop_nulls().to_list()
    assert [text.partition(":")[0] for text in told] == [
        f"arm1/{DATES[2]}/OJD_1.parquet", f"arm3/{DATES[1]}/copy_1.parquet", f"arm4/{DATES[0]}/lost_2.parquet", "arm5",
    ]  # fmt: skip
    assert "not a whole parquet file" in told[0]
    assert f"has the content of arm3/{DATES[0]}/OJD_1.parquet" in told[1]


def test_the_arm_that_changed_is_first_and_the_only_one_diagnosed(first):
    _, found = first
    assert [item.arm for item in found.arms if item.changes] == [WORN] == [found.ranked[0].arm]
    assert [item.arm for item in found.arms if item.diagnosis is not None] == [WORN]
    assert found.ranked[0].sentences[0].startswith("Coulomb friction of joint2 up 6")
    verdicts = {item.arm: item.verdict for item in found.arms}
    assert verdicts == {
        "arm1": "unchanged",
        WORN: "changed",
        "arm3": "unchanged",
        "arm4": "unchanged",
        "arm5": "no data",
    }
    rows = fleet_table(found)
    rows = rows.filter(rows["effect"].is_not_null())
    assert set(rows["quantity"]) == {"a02"} and set(rows["effect"]) == {"friction"}


def test_a_second_run_changes_nothing_and_starts_no_engine(first, broken, monkeypatch):
    output, found = first
    before = state(output)
    monkeypatch.setattr("scara_ident.fleet.work.started", None)
    again = watch_fleet(str(broken), load_robot(), output)
    assert fleet_table(again).equals(fleet_table(found))
    assert state(output) == before


def test_an_object_store_gives_the_same(folder, cluster, first, tmp_path, monkeypatch):
    moto = pytest.importorskip("moto.server")
    import s3fs
    from distributed import Client

    server = moto.ThreadedMotoServer(port=0, verbose=False)
    server.start()
    try:
        host, port = server.get_host_and_port()
        names = {"AWS_ACCESS_KEY_ID": "none", "AWS_SECRET_ACCESS_KEY": "none", "AWS_DEFAULT_REGION": "us-east-1"}
        names["AWS_ENDPOINT_URL"] = f"http://{host}:{port}"
        for name, value in names.items():
            monkeypatch.setenv(name, value)
        with Client(cluster, set_as_default=False) as client:
            client.run(set_environment, names)
        fs = s3fs.S3FileSystem()
        fs.mkdir("plant")
        for arm in ("arm1", "arm3"):
            for date in DATES[:2]:
                fs.put(str(folder / arm / date / "OJD_1.parquet"), f"plant/fleet/{arm}/{date}/OJD_1.parquet")
        settings = Settings(scheduler=cluster.scheduler_address, diagnosed=False)
        found = watch_fleet("s3://plant/fleet", load_robot(), tmp_path, settings)
    finally:
        server.stop()
    assert found.faults == ()
    _, local = first
    for item in found.arms:
        known = next(one for one in local.arms if one.arm == item.arm)
        for visit, other in zip(item.known.visits, known.known.visits, strict=False):
            assert (visit.value == other.value).all() and (visit.std == other.std).all()


def set_environment(values: dict[str, str]) -> None:
    import os

    os.environ.update(values)


def test_an_arm_that_is_odd_from_its_first_date_on_is_named(tmp_path):
    """With friction four times that of all others it had one date, or was unchanged, and that was all."""
    for arm in range(1, 7):
        place = tmp_path / "fleet" / f"arm{arm}" / DATES[0]
        place.mkdir(parents=True)
        write_recording(run_of(arm, 0, 4.0 if arm == 3 else 1.0), place / "OJD_1.parquet")
    found = watch_fleet(str(tmp_path / "fleet"), load_robot(), tmp_path / "results", Settings(workers=1))
    assert [item.arm for item in found.arms if item.odd] == ["arm3"] == [found.ranked[0].arm]
    assert found.ranked[0].oddities[0].startswith("On its first date a02 (Coulomb friction of joint2) is ")
    assert {item.verdict for item in found.arms} == {"one date"}
