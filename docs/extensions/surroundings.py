"""Exit statuses as Markdown, made from the errors themselves."""

import aosplan
from aosplan import errors


def statuses():
    """The errors that aosplan raises, and the exit status of each."""
    rows = ["| error | status | meaning |", "|---|---|---|"]
    for name, each in vars(errors).items():
        if isinstance(each, type) and issubclass(each, errors.AosplanError):
            meaning = (each.__doc__ or "").split("\n\n")[0].strip()
            home = "aosplan" if name in aosplan.__all__ else "aosplan.errors"
            rows.append(f"| {{py:exc}}`~{home}.{name}` | {each.exit_status} | {meaning} |")
    return "\n".join(rows)
