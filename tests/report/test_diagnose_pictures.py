from __future__ import annotations

import io
from dataclasses import replace

import pytest
from matplotlib.image import imread

from tests.updating.cases import VERDICTS, diagnosed
from toolpath_stiff.report.diagnose import page as diagnose_html
from toolpath_stiff.report.explanations import headline
from toolpath_stiff.report.pictures.diagnose import fits, ladder
from toolpath_stiff.report.pictures.files import picture_file

PICTURES = (ladder, fits)


@pytest.mark.parametrize("draw", PICTURES)
@pytest.mark.parametrize("name", VERDICTS)
def test_every_verdict_is_drawn(name, draw):
    diagnosis = diagnosed(*VERDICTS[name])
    first = picture_file("x.png", draw, diagnosis)
    assert imread(io.BytesIO(first), format="png").shape[1] >= 700
    if name == "ambiguous":  # once more, of the one that shows the most
        again = picture_file("x.png", draw, diagnosis)
        assert again == first


def test_a_description_is_not_told_as_an_explanation():
    diagnosis = replace(diagnosed(*VERDICTS["identified"]), verdict="described")
    assert headline(diagnosis).endswith("(described, not confirmed)")
    page = diagnose_html(diagnosis, {})
    assert "describes it" in page and "is the explanation" not in page
    assert 'class="verdict described"' in page
