"""Configurations: checked whole, with errors that name key, value and range."""

import tomllib
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tauguard.datasets.configuration import NAMED, Configuration, load_configuration, parse
from tauguard.datasets.schedule import dealt, planned, stated_balance

GOOD = """
name = "a"
seed = 1
[episodes]
arms = ["cura6"]
individuals = [0]
speeds = [10, 30]
[[splits]]
name = "train"
episodes = 4
"""


@pytest.mark.parametrize("name", NAMED)
def test_what_ships_is_whole_and_survives_json(name):
    configuration = load_configuration(name)
    assert Configuration.from_json(configuration.to_json()) == configuration
    assert configuration.name == name
    assert configuration.quick().hours < configuration.hours / 5


def test_objects_stand_in_every_episode_and_survive_json(tmp_path):
    (tmp_path / "cell.toml").write_text(
        '[[object]]\nname = "post"\nposition = [0.9, 0.5, 0.2]\n'
        '[[object.shapes]]\nkind = "cylinder"\nsize = [0.05, 0.2]\n'
    )
    configuration = parse(tomllib.loads('objects = "cell.toml"' + GOOD), tmp_path)
    assert [one.name for one in configuration.objects] == ["post"]
    assert Configuration.from_json(configuration.to_json()) == configuration
    assert configuration.sha256 != parse(tomllib.loads(GOOD)).sha256
    episode = planned(configuration, configuration.splits[0], 0).episode
    assert episode.objects == configuration.objects
    with pytest.raises(FileNotFoundError, match=r"none\.toml"):
        parse(tomllib.loads('objects = "none.toml"' + GOOD), tmp_path)


@pytest.mark.parametrize("version", ["v1", "v2"])
def test_the_benchmark_is_100_hours_of_four_arms(version):
    configuration = load_configuration(f"tauguard-collisions-{version}")
    assert configuration.hours == pytest.approx(100, rel=1e-3)
    assert configuration.quick().hours == pytest.approx(2, rel=0.01)
    assert len({arm for split in configuration.splits for arm in split.arms}) == 4


def test_the_twin_has_15_slices_of_7_minutes_and_65_collisions_a_speed():
    train, *judged = load_configuration("cura6-twin").splits
    assert train.episodes * train.seconds == 15 * 7 * 60
    assert sorted(train.payloads_g).count(0) == 3
    assert [split.speeds for split in judged] == [(v,) for v in (10, 20, 30, 40, 50, 60)]
    for stated in [
        stated_balance(load_configuration("cura6-twin"))[split.name] for split in judged
    ]:
        assert sum(stated["kind"].values()) == 65


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("speeds = [10, 30]", "speeds = [10, 130]", r"speeds = \[10, 130\]: expected a list"),
        ("speeds = [10, 30]", "speed = [10]", r"episodes\.speed: unknown key \(did you mean"),
        ("episodes = 4", "episodes = 0", r"splits\[0\]\.episodes = 0: expected a whole number, 1"),
        ("episodes = 4", "episodes = true", "episodes = True"),
        ("episodes = 4", "seconds = 60", r"splits\[0\]\.episodes: missing"),
        ("seed = 1", "seed = -1", "seed = -1: expected a whole number, 0 to"),
        ("seed = 1", "seed = 1\nrate = 300", "rate = 300: expected rows per second"),
        ('["cura6"]', '["cura7"]', r"splits\[0\]\.arms: arm 'cura7': no such .*mean cura6\?"),
        ('["cura6"]', "[6]", "arms = .*expected a list of cura6, cura6-small"),
        ("episodes = 4", "episodes = 4\nlinks = [7]", r"links = \(7,\): expected 1 to 6, links"),
        ("episodes = 4", "episodes = 4\nseconds = 5", r"collisions = 0: expected 1 to 0"),
        ("episodes = 4", 'episodes = 4\nunseen = ["arm"]', "unseen.*expected nothing"),
        ("episodes = 4", "episodes = 4\nspeeds = [nan]", "speeds"),
        ('name = "a"', 'name = "../a"', "name = '../a': expected small letters"),
        ('name = "train"', 'name = "../a"', r"splits\[0\]\.name"),
        ("episodes = 4", "episodes = 3\npaired = true", "expected even numbers"),
        ("episodes = 4", "episodes = 4\npaired = true\nstruck = 0.3", "struck = 0.5 and picks = 0"),
        ("episodes = 4", "episodes = 4\nclamp_seconds = [1, 2]", "seconds, 0.05 to 1.4"),
        ("episodes = 4", "episodes = 4\n[mismatch]\nmass = 3", r"mismatch\.mass = 3: expected a"),
    ],
)  # fmt: skip
def test_an_error_names_key_value_and_range(old, new, message):
    with pytest.raises(ValueError, match=message):
        parse(tomllib.loads(GOOD.replace(old, new, 1)))


def test_a_split_may_not_share_what_it_calls_unseen():
    more = '[[splits]]\nname = "test"\nepisodes = 2\nunseen = ["individual"]\n'
    with pytest.raises(ValueError, match=r"splits\[1\]\.unseen: test shares individual"):
        parse(tomllib.loads(GOOD + more))
    parse(tomllib.loads(GOOD + more + "individuals = [1]\n"))


@pytest.mark.parametrize("text", ["a = ", "\x00", "[[splits]]\n" * 3, "splits = 3"])
def test_what_is_no_configuration_is_refused_with_the_files_name(tmp_path, text):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"bad\.toml"):
        load_configuration(path)


def test_a_name_that_does_not_ship_is_met_with_those_that_do():
    with pytest.raises(FileNotFoundError, match=r"did you mean cura6-twin\?"):
        load_configuration("cura6-twins")


@settings(deadline=None)
@given(values=st.integers(1, 9), seed=st.integers(0, 99), count=st.integers(0, 60))
def test_a_deck_deals_every_value_equally_often(values, seed, count):
    found = [dealt(range(values), [seed], i) for i in range(count)]
    for value in range(values):
        assert abs(found.count(value) - count / values) < 1


def test_hashes_of_published_descriptions_stay():
    assert load_configuration("tauguard-collisions-v1").sha256.startswith("ba6ceca843d9d137")


def all_planned(configuration):
    return [planned(configuration, s, k) for s in configuration.splits for k in range(s.episodes)]


def test_a_pair_has_one_motion_and_the_second_has_the_collisions():
    configuration = load_configuration("tauguard-collisions-v2").quick()
    episodes = [p for p in all_planned(configuration) if p.split == "test"]
    assert len(episodes) == configuration.splits[2].episodes
    for free, struck in zip(episodes[::2], episodes[1::2], strict=True):
        assert free.number + 1 == struck.number
        assert not free.episode.collisions
        assert struck.episode.collisions
        assert replace(struck.episode, collisions=()) == free.episode
    motions = {p.episode.seed for p in all_planned(configuration)}
    assert len(motions) == sum(split.episodes for split in configuration.splits) // 2


@pytest.mark.parametrize("version", ["v1", "v2"])
def test_the_stated_balance_is_that_of_the_episodes(version):
    configuration = load_configuration(f"tauguard-collisions-{version}").quick()
    stated = stated_balance(configuration)
    for split in configuration.splits:
        episodes = [p.episode for p in all_planned(configuration) if p.split == split.name]
        plans = [c for e in episodes for c in e.collisions]
        for kind, count in stated[split.name]["kind"].items():
            assert sum(c.kind == kind for c in plans) == count
        for link, count in stated[split.name]["link"].items():
            assert sum(c.link == int(link) for c in plans) == count
        for speed, count in stated[split.name]["speed"].items():
            assert sum(e.speed == float(speed) for e in episodes) == count


def test_an_episode_depends_on_its_number_alone_and_quick_is_the_beginning():
    whole = load_configuration("tauguard-collisions-v1")
    part = whole.quick()
    for split, quick in zip(whole.splits, part.splits, strict=True):
        last = quick.episodes - 1
        assert planned(whole, split, last) == planned(part, quick, last)
        key = planned(whole, split, last).key(whole, "code")
        assert key == planned(part, quick, last).key(part, "code")
    seeds = [p.episode.seed for p in all_planned(part)]
    assert len(set(seeds)) == len(seeds)
