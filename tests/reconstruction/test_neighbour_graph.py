import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.evaluation_runs import tracker_frames
from devices.errors import FileError
from devices.sample import ROLES
from reconstruction import neighbour_graph
from reconstruction.database import open_database
from reconstruction.neighbour_graph import APART, NeighbourGraph, choose_links, walk
from reconstruction.paper_histories import (
    FOLDER,
    GraphSearch,
    TreeSearch,
    add_neighbour_graph,
    graph_search,
    histories,
    history_search,
)
from reconstruction.paper_predictor import PaperPredictor
from reconstruction.solver import Reconstructor
from tests.reconstruction.conftest import strolling


@pytest.fixture(scope="module")
def search(database) -> GraphSearch:
    return graph_search(database)


def walk_in_python(query, begin, vectors, links, most):
    """The walk as its description says, on plain lists."""
    seen, around = dict.fromkeys(begin), set()

    def nearest():
        return sorted(seen, key=lambda number: np.sum((vectors[number].astype(float) - query) ** 2))[:most]

    while left := [number for number in nearest() if number not in around]:
        around.add(left[0])
        seen |= dict.fromkeys(link for link in links[left[0]].tolist() if link >= 0)
    return nearest()


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
@settings(max_examples=30, deadline=None)
def test_the_walk_is_what_it_says(seed: int, most: int) -> None:
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(60, 3)).astype(np.float32)
    links = rng.integers(-1, 60, (60, 4)).astype(np.int32)
    query, begin = rng.normal(size=3).astype(np.float32), rng.integers(0, 60, 5)
    numbers, squares = np.empty(most, np.int64), np.empty(most)
    found = walk(query, begin, vectors, links, numbers, squares)
    assert numbers[:found].tolist() == walk_in_python(query, begin.tolist(), vectors, links, most)
    np.testing.assert_allclose(squares[:found], np.sum((vectors[numbers[:found]] - query) ** 2, axis=1), rtol=1e-5)


def test_links_lead_to_other_moments(search: GraphSearch, database) -> None:
    links = search.graph.links
    rows = np.asarray(database.windows)
    for number in range(0, len(links), 37):
        before, after, *others = links[number].tolist()
        assert before < 0 or rows[before] == rows[number] - 1
        assert after < 0 or rows[after] == rows[number] + 1
        there = np.array([number, *(link for link in others if link >= 0)])
        assert np.abs(there[:, None] - there)[~np.eye(len(there), dtype=bool)].min() >= APART


def test_the_first_of_the_nearest_are_linked() -> None:
    links = np.full((1, 3), -1, np.int32)
    choose_links(np.array([[10, 11, 20, 23, 24, 40, 50]]), 10, 4, links)
    assert links.tolist() == [[20, 24, 40]]


def test_a_walk_from_last_frames_neighbours_finds_the_true_ones(search: GraphSearch, database) -> None:
    moving = np.asarray(histories(database, database.windows[100:200]))
    queries = search.space.projected(moving + np.random.default_rng(3).normal(0, 0.005, moving.shape))
    tree, shares = TreeSearch(database), []
    near = search.graph.begun(queries[0], 48)[0]
    for query in queries[1:]:
        near, distances = search.graph.nearest(query, near, 48)
        assert (np.diff(distances) >= 0).all()
        exact = tree.nearest(query, [], 48)[1]
        shares.append(np.mean(distances <= exact[-1] * (1 + 1e-5)))
    assert np.mean(shares) > 0.97


def test_a_walk_begins_among_windows_spread_over_the_database(search: GraphSearch, database, monkeypatch) -> None:
    monkeypatch.setattr(neighbour_graph, "LOOKED_AT", 100)
    query = search.graph.vectors[777] + np.float32(0.001)
    found = search.graph.begun(query, 20)
    exact = TreeSearch(database).nearest(query, [], 20)
    assert found[0][0] == exact[0][0] == 777
    assert np.mean(found[1] <= exact[1][-1] * (1 + 1e-5)) > 0.9


def test_a_graph_made_with_the_database_is_what_the_papers_method_walks(database, tmp_path) -> None:
    path = tmp_path / "with graph"
    shutil.copytree(database.path, path)
    with_graph = open_database(path)
    assert isinstance(history_search(with_graph), TreeSearch)
    add_neighbour_graph(with_graph)
    assert sorted(file.name for file in path.iterdir() if file.name.startswith(".")) == []
    predictor = PaperPredictor(with_graph, 1.0)
    assert isinstance(predictor.search, GraphSearch)
    frames = tracker_frames(strolling(31, 60), ROLES)
    walked = Reconstructor(with_graph, predictor=predictor)
    one, again = walked.solve_take(frames).motion, walked.solve_take(frames).motion
    exact = Reconstructor(database, predictor=PaperPredictor(database, 1.0)).solve_take(frames).motion
    assert np.array_equal(one.rotations, again.rotations)
    apart = np.linalg.norm(one.root_positions - exact.root_positions, axis=1)
    assert apart.mean() < 0.01


def test_another_databases_graph_is_refused(database, tmp_path) -> None:
    path = tmp_path / "broken"
    shutil.copytree(database.path, path)
    add_neighbour_graph(open_database(path))
    links = path / FOLDER / "links.npy"
    np.save(links, np.load(links)[:-1])
    with pytest.raises(FileError, match="not this database's graph"):
        history_search(open_database(path))
    links.unlink()
    with pytest.raises(FileError, match="build the database again"):
        history_search(open_database(path))


def test_a_graph_of_few_windows_has_what_links_there_are() -> None:
    graph = NeighbourGraph.built(np.zeros((3, 2), np.float32), np.array([5, 6, 9], np.int32))
    assert graph.links[:, :2].tolist() == [[-1, 1], [0, -1], [-1, -1]]
    assert len(graph) == 3
