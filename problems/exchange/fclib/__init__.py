"""FCLIB files, in which the field exchanges frictional contact problems: read, written and looked over."""
