import math

import pytest
from ledger import Ledger, fill_in


def test_a_row_adds_up_cases_and_keeps_the_worst():
    ledger = Ledger()
    ledger.record("kernels", "basis", "seams", cases=3, worst=1e-16, bound=1e-15)
    ledger.record("kernels", "basis", "seams", cases=4, worst=5e-16, bound=1e-15)
    assert ledger.cases() == ledger.cases("kernels") == 7
    assert ledger.cases("files") == 0
    assert "| basis | seams | 7 | 5e-16 | 1e-15 |" in ledger.table("kernels")


@pytest.mark.parametrize("worst", [2.0, math.inf, math.nan])
def test_what_exceeds_its_bound_fails_and_is_not_forgotten(worst):
    ledger = Ledger()
    with pytest.raises(AssertionError, match="promised"):
        ledger.record("kernels", "basis", "seams", cases=1, worst=worst, bound=1.0)
    assert not ledger.rows["kernels", "basis"].worst <= 1.0


def test_the_page_gets_the_tables_between_its_markers_and_keeps_the_rest():
    ledger = Ledger()
    ledger.record("files", "PLY", r"cut at \d bytes", cases=2, worst=0, bound=0, unit="tracebacks")
    kept = "b\n<!-- stress:faults -->\nkept\n<!-- /stress:faults -->\n"
    page = "a\n<!-- stress:files -->\nold\n<!-- /stress:files -->\n" + kept
    filled = fill_in(page, ledger)
    assert "old" not in filled
    assert r"| PLY | cut at \d bytes | 2 | 0 tracebacks | 0 tracebacks |" in filled
    assert filled.startswith("a\n")
    assert filled.endswith(kept)
    assert fill_in(filled, ledger) == filled
