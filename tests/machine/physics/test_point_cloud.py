from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.physics.point_cloud import DIGITIZER_COLUMNS, cloud_blocks, transform_cloud


def summed(rows):
    """A transformation easy to follow: x = u + D, y = v + E, z = F."""
    return np.column_stack([rows[:, 0] + rows[:, 2], rows[:, 1] + rows[:, 3], rows[:, 4]])


@pytest.fixture
def cloud():
    return np.random.default_rng(1).normal(size=(1000, 5))


def test_a_file_becomes_the_same_as_in_memory(tmp_path, cloud):
    np.save(tmp_path / "cloud.npy", cloud)
    assert transform_cloud(tmp_path / "cloud.npy", tmp_path / "xyz.npy", summed, block=64) == 1000
    np.testing.assert_array_equal(np.load(tmp_path / "xyz.npy"), summed(cloud))


def test_a_folder_of_chunks_is_one_cloud(tmp_path, cloud):
    (tmp_path / "chunks").mkdir()
    for i, chunk in enumerate(np.array_split(cloud.astype(np.float32), 3)):
        np.save(tmp_path / "chunks" / f"{i:03}.npy", chunk)
    transform_cloud(tmp_path / "chunks", tmp_path / "xyz.npy", summed, block=100)
    np.testing.assert_array_equal(np.load(tmp_path / "xyz.npy"), summed(cloud.astype(np.float32).astype(np.float64)))


def test_memory_is_that_of_a_block_whatever_the_length(tmp_path):
    peaks = []
    for n in (20_000, 200_000):
        np.save(tmp_path / "cloud.npy", np.ones((n, 5)))
        tracemalloc.start()
        transform_cloud(tmp_path / "cloud.npy", tmp_path / "xyz.npy", summed, block=5_000)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]
    assert peaks[1] < 200 * 5_000


def test_parquet_in_and_out(tmp_path, cloud):
    arrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    parquet.write_table(arrow.table(dict(zip((*DIGITIZER_COLUMNS, "power"), [*cloud.T, cloud[:, 0]], strict=True))),
                        tmp_path / "cloud.parquet")  # fmt: skip
    assert transform_cloud(tmp_path / "cloud.parquet", tmp_path / "xyz.parquet", summed, block=300) == 1000
    found = parquet.read_table(tmp_path / "xyz.parquet")
    np.testing.assert_array_equal(np.column_stack([found[f"{a}_mm"] for a in "xyz"]), summed(cloud))
    with pytest.raises(CmmUqError, match="has no column time_s"):
        list(cloud_blocks(tmp_path / "cloud.parquet", ("time_s",)))
    (tmp_path / "no.parquet").write_bytes(b"no")
    with pytest.raises(CmmUqError, match="is no Parquet file"):
        list(cloud_blocks(tmp_path / "no.parquet"))


def test_nothing_is_left_behind_when_a_point_is_refused(tmp_path, cloud):
    np.save(tmp_path / "cloud.npy", cloud)

    def refuse_later(rows):
        if rows[0, 0] == cloud[500, 0]:
            raise CmmUqError("x reads 901 mm", where="point 7")
        return rows[:, :3]

    with pytest.raises(CmmUqError, match=r"cloud\.npy, rows from 501: point 7: x reads 901 mm"):
        transform_cloud(tmp_path / "cloud.npy", tmp_path / "xyz.npy", refuse_later, block=100)
    assert [path.name for path in tmp_path.iterdir()] == ["cloud.npy"]


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((10, 4)), r"float64 of shape \(10, 4\)"),
        (np.zeros(10), r"shape \(10,\)"),
        (np.zeros((10, 5), dtype=int), "int64"),
        (np.asfortranarray(np.ones((10, 5))), "column by column"),
    ],
)
def test_arrays_that_are_no_cloud_are_refused(tmp_path, array, message):
    np.save(tmp_path / "cloud.npy", array)
    with pytest.raises(CmmUqError, match=message):
        list(cloud_blocks(tmp_path / "cloud.npy"))


def test_files_that_are_no_cloud_are_refused(tmp_path, cloud):
    np.save(tmp_path / "cloud.npy", cloud)
    whole = (tmp_path / "cloud.npy").read_bytes()
    (tmp_path / "cloud.npy").write_bytes(whole[:-100])
    with pytest.raises(CmmUqError, match="ends before its last row"):
        list(cloud_blocks(tmp_path / "cloud.npy"))
    (tmp_path / "cloud.npy").write_bytes(b"x,y,z\n1,2,3\n")
    with pytest.raises(CmmUqError, match=r"is no \.npy file"):
        list(cloud_blocks(tmp_path / "cloud.npy"))
    with pytest.raises(CmmUqError, match="cannot be read"):
        list(cloud_blocks(tmp_path / "none.npy"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(CmmUqError, match=r"no \.npy files"):
        list(cloud_blocks(tmp_path / "empty"))
