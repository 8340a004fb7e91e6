"""Faults that kills, full disks and spoilt folders have shown (`make hardening`)."""

import errno
import gc
import io
import json
import os
import stat
import sys
from dataclasses import dataclass

import h5py
import numpy as np
import pytest
import xarray as xr

from spindle_fem import cache
from spindle_fem.errors import BadInputError, MeshTagError, NoSpaceError, RecordingError, of_system
from spindle_fem.machine.meshing.mesh_cache import load_npz
from spindle_fem.recordings.measurement_file import read_measurement
from spindle_fem.results.dataset import load_netcdf, write_dataset
from spindle_fem.results.output_folder import (
    MARKER,
    output_folder,
    reading_results,
    replace_bytes,
    whole_file,
)
from spindle_fem.studies.watch import Watching, watch_recording
from validation.hardening.material import PUMP, pump_recording, write_recording


@dataclass
class Kept:
    name: str
    values: np.ndarray


@dataclass
class Longer(Kept):
    more: np.ndarray


class Poison:
    def __reduce__(self):
        return os.mkdir, ("poisoned",)


SOUND = Kept("sound", np.arange(5.0))
SCHEMA = "spindle-fem/test/1"


def test_entries_of_a_cache_are_for_all_users_and_of_one_kind(tmp_path):
    file = tmp_path / "entry.npz"
    cache.save_record(SOUND, file, SCHEMA)
    assert cache.load_record(file, SCHEMA, Kept)["name"] == "sound"
    assert cache.load_record(file, SCHEMA, Longer) is None
    assert cache.load_record(file, "spindle-fem/test/2", Kept) is None
    plain = tmp_path / "plain"
    plain.write_text("")
    assert stat.S_IMODE(file.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_an_entry_that_cannot_be_kept_is_logged_and_nothing_is_left(tmp_path, caplog):
    def full(stream):
        stream.write(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    cache.keep_entry(tmp_path / "entry.npz", full)
    assert "No space left" in caplog.text
    assert not list(tmp_path.iterdir())


def test_a_poisoned_entry_is_not_unpickled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stream = io.BytesIO()
    np.savez(stream, header=json.dumps({"schema": SCHEMA}), values=np.array([Poison()], dtype=object))
    (tmp_path / "entry.npz").write_bytes(stream.getvalue())
    assert cache.load_record(tmp_path / "entry.npz", SCHEMA, Kept) is None
    with pytest.raises(MeshTagError):
        load_npz(tmp_path / "entry.npz")
    assert not (tmp_path / "poisoned").exists()


def test_a_lock_of_another_user_is_held_for_reading(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.CACHE_VARIABLE, str(tmp_path))
    (tmp_path / "mesh.lock").touch()
    opened = cache.Path.open
    modes = []

    def of_another(path, mode="r", *rest, **more):
        modes.append(mode)
        if "a" in mode:
            raise PermissionError(errno.EACCES, "denied")
        return opened(path, mode, *rest, **more)

    monkeypatch.setattr(cache.Path, "open", of_another)
    with cache.one_at_a_time("mesh"):
        assert modes == ["ab", "rb"]


def test_groups_of_a_dataset_come_into_one_file(tmp_path):
    file = tmp_path / "result.nc"
    write_dataset(xr.Dataset({"a": ("x", np.arange(3.0))}), file)
    write_dataset(xr.Dataset({"b": ("y", np.arange(4.0))}), file, group="more")
    with h5py.File(file) as found:
        assert set(found) >= {"a", "more"}
        assert "b" in found["more"]


def test_a_file_that_does_not_fit_leaves_the_old_one(tmp_path, monkeypatch):
    file = tmp_path / "summary.json"
    replace_bytes(file, b"old")

    def full(path, content):
        path.touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(type(file), "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        replace_bytes(file, b"new")
    assert file.read_bytes() == b"old"
    assert [item.name for item in tmp_path.iterdir()] == ["summary.json"]


def test_a_full_disk_leaves_the_marker_and_its_own_message(tmp_path, monkeypatch):
    place = tmp_path / "out"

    def full(*told, **more):
        raise OSError(errno.ENOSPC, "second")

    def fill():
        monkeypatch.setattr(type(place), "write_text", full)
        raise OSError(errno.ENOSPC, "first")

    with pytest.raises(OSError, match="first"), output_folder(place):
        fill()
    assert (place / MARKER).exists()


@pytest.mark.parametrize("error", [KeyError("bearings"), ValueError("no JSON"), OSError("no HDF5")])
def test_files_that_somebody_changed_are_told_as_such(tmp_path, error):
    with pytest.raises(BadInputError, match="damaged or changed"), reading_results(tmp_path):
        raise error


def test_a_disk_that_is_full_is_no_damaged_file(tmp_path):
    with pytest.raises(OSError, match="full"), reading_results(tmp_path):
        raise OSError(errno.ENOSPC, "full")


def test_what_the_system_refuses_is_told_with_its_path_and_its_status():
    full = of_system(OSError(errno.EFBIG, os.strerror(errno.EFBIG)))
    assert isinstance(full, NoSpaceError)
    assert full.exit_status == 1
    refused = of_system(OSError(errno.EROFS, os.strerror(errno.EROFS), "out/new.toml"))
    assert refused.exit_status == 2
    assert str(refused).startswith("out/new.toml: ")
    other = OSError("HDF5 says something")
    assert of_system(other) is other


def test_a_file_takes_its_place_when_it_is_whole(tmp_path):
    file = tmp_path / "mesh.vtu"
    file.write_text("old")

    def fail(path):
        path.write_text("half")
        raise OSError(errno.ENOSPC, "full")

    with pytest.raises(OSError, match="full"), whole_file(file) as partial:
        fail(partial)
    assert file.read_text() == "old"
    with whole_file(file) as partial:
        partial.write_text("new")
    assert [item.read_text() for item in tmp_path.iterdir()] == ["new"]


def attributes_read(file):
    with h5py.File(file) as content:
        return dict(content.attrs)


def test_a_file_whose_attributes_are_spoilt_is_refused_once(tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    file = tmp_path / "result.nc"
    write_dataset(xr.Dataset({"x": ("n", np.arange(3.0))}, attrs={"schema": "s" * 300}), file)
    content = file.read_bytes()
    for place in range(96, len(content), 8):
        file.write_bytes(content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :])
        try:
            attributes_read(file)
        except KeyError:
            break
        except (OSError, RuntimeError):
            continue
    with pytest.raises(KeyError):
        load_netcdf(file)
    gc.collect()
    assert not told


def test_a_quote_that_is_left_open_is_told_with_its_line(tmp_path):
    file = tmp_path / "data.csv"
    file.write_text("t,T\n" + "0,1\n" * 5 + '5,"' + "6,1\n" * 40_000)
    with pytest.raises(RecordingError, match="quote"):
        read_measurement(file)


def test_a_watch_without_an_input_ends_with_a_reason(tmp_path):
    manifest, table = pump_recording()
    table["room"] = np.nan
    file = write_recording(tmp_path, (manifest, table), "made")
    how = Watching(warm_up=2400.0, until_end=True)
    with pytest.raises(RecordingError, match="every input"):
        list(watch_recording(PUMP, file, how))
