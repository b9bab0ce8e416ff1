"""Reads submissions: a folder with a scene or a file of tracks for each instruction's id."""

from __future__ import annotations

from pathlib import Path

from scenewright.dataset.batch.rows import choose_folder
from scenewright.errors import InputError
from scenewright.evals.satisfaction.judge import Submission
from scenewright.evals.satisfaction.seen import see_agents
from scenewright.graph.run import load_scene, load_tracks, verify, verify_tracks
from scenewright.intersections import load_map
from scenewright.tools.relation_checker import read_users


def read_submission(folder: Path, identity: str, *, intersection: str) -> Submission | None:
    """What was submitted for an instruction; None where nothing was.

    Args:
        folder: holds `ID/scene.json` (as `scenewright batch` writes it) or `ID.SUFFIX`, tracks in
            any format that `verify` reads.
        intersection: map of the tracks; a scene.json names its own.

    Raises:
        InputError: more than one file for an instruction.
    """
    name = choose_folder(identity)
    if (folder / name / "scene.json").is_file():
        # A scene of ours: its tracks, and whether its proof and its account of words hold.
        record, proof, fault = load_scene(folder / name), verify(folder / name), None
        if not proof.verified:
            fault = "the checker does not confirm the scene"
        elif proof.verdict == "partly":
            fault = proof.describe_verdict()
        agents = see_agents(read_users(record), load_map(record.meta.intersection))
        events = (*proof.events, *proof.incidental)
        return Submission(agents, events, record.meta.time_of_day, fault)
    files = sorted(path for path in folder.glob(f"{name}.*") if path.is_file())
    if len(files) > 1:
        raise InputError(f"{files[0]} and {files[1]} are both for {identity}; keep one")
    if not files:
        return None
    try:
        tracks = load_tracks(files[0])
    except InputError as error:  # what cannot be read speaks against it
        return Submission((), (), fault=f"cannot be read: {error}")
    agents = see_agents(tracks.users, load_map(intersection))
    return Submission(agents, verify_tracks(tracks, intersection=intersection))
