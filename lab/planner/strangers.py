"""How many strangers' texts are planned as their marks say: `python -m lab.planner.strangers`.

`strangers.txt` was written by twelve voices who had seen at most 60 rows of the corpus and
nothing of the planner; it is never trained on. A text is right where its plan is that of its marks.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from lab.planner.plain_sentences import build_reading
from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.planner import is_same_plan, plan
from scenewright.backends.builtin.reader.learned_plan import plan_reading, read_plan
from scenewright.backends.builtin.training.corpus import read_corpus
from scenewright.evals.bootstrap import Figure
from scenewright.scene.social import Plan, Refusal


def judge(meant: Plan, found: Plan) -> str:
    """`right`, `wrong`, or `refused` though there is a plan."""
    if isinstance(found, Refusal):
        return "right" if isinstance(meant, Refusal) else "refused"
    return "right" if is_same_plan(meant, found) else "wrong"


def main() -> None:
    """Print the counts of the planner and of its reading alone."""
    rows = read_corpus([Path(__file__).with_name("strangers.txt")])
    planned: Counter[str] = Counter()
    read: Counter[str] = Counter()
    offered = 0
    for row in rows:
        meant = plan_reading(build_reading(row), Site(), row.text).plan
        found = plan(row.text)
        planned[judge(meant, found)] += 1
        read[judge(meant, read_plan(row.text).plan)] += 1
        if judge(meant, found) == "refused" and isinstance(found, Refusal):
            sentences = [plan(each) for each in found.did_you_mean]
            offered += any(judge(meant, each) == "right" for each in sentences)
    for name, counts in (("planned", planned), ("read, however unsure", read)):
        share = f"{Figure.of_count(counts['right'], len(rows)):.1%}"
        print(f"{name}: {dict(counts)} of {len(rows)}; right {share}")
    print(f"right among the sentences offered: {offered}")


if __name__ == "__main__":
    main()
