"""What a whole motion is measured by: the error of a limit cycle, the flow of a pour, the end that is known."""
