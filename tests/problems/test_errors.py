"""Messages suggest only similar names, and name the line of the author's file."""

import json

import pytest
from proxbench.problems.errors import raised_at, suggestion
from proxbench.problems.motion.scenes.registry import SCENES


@pytest.mark.parametrize(
    ("name", "near"),
    [("funel", "funnel"), ("HOPPER", "hopper"), ("brick", "brick_wall"), ("newtons", "newtons_cradle")],
)
def test_misspelled_or_shortened_names_get_a_suggestion(name: str, near: str) -> None:
    assert suggestion(name, SCENES) == f"; did you mean {near!r}?"


@pytest.mark.parametrize(("name", "near"), [("Moro", "Moreau"), ("SPA", "SAP")])
def test_less_similar_names_are_suggested_if_they_have_the_same_initial(name: str, near: str) -> None:
    assert suggestion(name, ["SORprox", "Moreau", "SAP"]) == f"; did you mean {near!r}?"


@pytest.mark.parametrize("name", ["nope", "none", "mine", "dune", "rope"])
def test_unrelated_words_get_no_suggestion(name: str) -> None:
    listed = f"; {len(SCENES)} are known, and proxbench list scenes lists them."
    assert suggestion(name, SCENES, "proxbench list scenes") == listed


@pytest.mark.parametrize("name", SCENES)
def test_any_single_wrong_letter_is_corrected(name: str) -> None:
    for place in range(len(name)):
        wrong = f"{name[:place]}?{name[place + 1 :]}"
        assert suggestion(wrong, SCENES) == f"; did you mean {name!r}?"


def test_error_location_is_in_the_code_of_the_author_not_of_a_library() -> None:
    content = compile("import json\ndef parse():\n    return json.loads('{')\n", "/home/me/wrapped.py", "exec")
    names: dict[str, object] = {}
    exec(content, names)
    with pytest.raises(json.JSONDecodeError) as caught:
        names["parse"]()  # type: ignore[operator]
    assert raised_at(caught.value) == " (line 3 of wrapped.py)"


def test_exception_without_traceback_has_no_location() -> None:
    assert raised_at(ValueError("odd")) == ""
