"""Names with options are parsed as written."""

from keyword import iskeyword

import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ProblemError
from proxbench.problems.names import Name, check_options, read_name

WORDS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True).filter(lambda word: not iskeyword(word))
VALUES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
NAMES = st.recursive(
    st.builds(Name, WORDS, st.dictionaries(WORDS, VALUES, max_size=3)),
    lambda parts: st.builds(
        Name, WORDS, st.dictionaries(WORDS, VALUES, max_size=2), st.lists(parts, max_size=2).map(tuple)
    ),
    max_leaves=4,
)


def read(text: str) -> Name:
    return read_name(text, "scene", "funnel(balls=100)", ProblemError)


@given(NAMES)
def test_a_written_name_is_parsed_to_the_same_name(name: Name) -> None:
    assert read(str(name)) == name


@pytest.mark.parametrize(
    "text", ["", "a b", "f(", "f()()", "f(**x)", "f(1)", "f(x=y)", "f(x=__import__('os'))", "a.b", "[f]", "f(" * 500]
)
def test_an_invalid_name_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ProblemError, match=r"as a scene; write a name, or a name with options: funnel\(balls=100\)"):
        read(text)


def test_an_unknown_option_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(ProblemError, match=r"funnel has no option 'bals'; did you mean 'balls'\?"):
        check_options("funnel", ["bals"], ["balls", "outlet"], ProblemError)
