"""`Config`: presets, TOML, keys."""

from __future__ import annotations

import copy
import pickle

import pytest

import boresight as bs


def test_keys_are_set_by_keyword_and_read_back():
    config = bs.Config(tracker__coast_s=1.5, filter="ud", associator="jpda")
    text = config.to_toml()
    assert "coast-s = 1.5" in text and "[tracker.associator.jpda]" in text
    assert bs.Config.from_toml(text) == config and hash(bs.Config.from_toml(text)) == hash(config)
    assert config.set(tracker__coast_s=2) != config


def test_every_value_of_python_has_its_form_in_toml():
    config = bs.Config(
        tracker__merged_measurements__enabled=False,
        tracker__association_cost__overlap={"weight": 40.0, "min_overlap": 0.3, "buffer": 0.2},
        input__rate_hz=50,
        detector__threshold__band={"low": 1, "high": 2},
    )
    assert "weight = 40.0" in config.to_toml() and "rate-hz = 50.0" in config.to_toml()
    with pytest.raises(bs.BoresightError, match="a value of type object"):
        bs.Config(tracker__coast_s=object())


def test_presets_have_names(tmp_path):
    assert "detections-mot" in bs.Config.presets()
    for name in bs.Config.presets():
        config = bs.Config.preset(name)
        (tmp_path / "c.toml").write_text(config.to_toml())
        assert bs.Config.from_toml(tmp_path / "c.toml") == config
    with pytest.raises(bs.BoresightError) as e:
        bs.Config.preset("nonsense")
    assert e.value.kind == "not-found" and "known-band" in e.value.hint


def test_a_misspelt_key_is_told_with_what_there_is():
    with pytest.raises(bs.BoresightError) as e:
        bs.Config(tracker__gate_probabilty=0.9)
    assert "gate-probability" in str(e.value)
    with pytest.raises(bs.BoresightError, match="line 2"):
        bs.Config.from_toml("[tracker]\nnonsense = 1\n")
    with pytest.raises(bs.BoresightError) as e:
        bs.Config.from_toml("no_such.toml")
    assert e.value.kind == "not-found"


def test_the_choice_has_reasons_and_is_the_one_of_track(clip, drone):
    config = bs.Config.auto(clip)
    assert config.reasons == drone.config.reasons and config == drone.config


def test_a_choice_from_arrays(ds2):
    config = bs.Config.auto(ds2.frames, rate_hz=1.0, tracker__coast_s=0.7)
    assert config.reasons and config.to_toml().count("coast-s = 0.7") == 1


def test_a_configuration_is_copied_and_pickled():
    config = bs.Config(tracker__coast_s=1.5)
    assert pickle.loads(pickle.dumps(config)) == config == copy.deepcopy(config)
    assert "coast-s = 1.5" in repr(config)
