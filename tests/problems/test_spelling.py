"""A message is written once and read in two spellings."""

from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import PluginError, ProblemError, ProxbenchError
from proxbench.problems.spelling import either, for_command_line, for_python, option, switch

PLAIN = st.text(st.characters(exclude_characters="\ue000\ue001\ue002", exclude_categories=["Cs"]))


@given(before=PLAIN, command_line=PLAIN, python=PLAIN, after=PLAIN)
def test_each_reader_gets_its_own_spelling_and_all_of_the_rest(
    before: str, command_line: str, python: str, after: str
) -> None:
    text = f"{before}{either(command_line, python)}{after}"
    assert for_command_line(text) == f"{before}{command_line}{after}"
    assert for_python(text) == f"{before}{python}{after}"


@given(PLAIN)
def test_text_without_options_is_left_alone(text: str) -> None:
    assert for_python(text) == for_command_line(text) == text


def test_options_are_spelt_as_each_reader_gives_them() -> None:
    assert for_command_line(f"{option('run_id')} {switch('retry_failed')}") == "--run-id --retry-failed"
    assert for_python(f"{option('run_id')} {switch('retry_failed')}") == "run_id= retry_failed=True"


def test_errors_speak_python_and_keep_both_spellings() -> None:
    for kind in (ProxbenchError, ProblemError, PluginError):
        error = kind(f"choose another {option('run_id')}.")
        assert str(error) == "choose another run_id=."
        assert for_command_line(error.sentence) == "choose another --run-id."
        assert str(kind(error.sentence)) == str(error)
