from __future__ import annotations

import io
import json

import pytest
from matplotlib.image import imread

from tests.report import diagnose_documents as documents
from toolpath_stiff.report.diagnose.page import diagnose_html
from toolpath_stiff.report.diagnose.pictures import confounding_png, detectable_png, ladder_png
from toolpath_stiff.report.explanations import headline

PICTURES = (ladder_png, confounding_png, detectable_png)


@pytest.mark.parametrize("draw", PICTURES)
@pytest.mark.parametrize("name", documents.ALL)
def test_every_verdict_is_drawn(name, draw):
    document = json.loads(json.dumps(documents.ALL[name]()))
    first = draw(document)
    assert imread(io.BytesIO(first), format="png").shape[1] >= 700
    if name == "ambiguous":  # once more, of the one that shows the most
        again = draw(document)
        assert again == first and again.svg == first.svg


def test_a_description_is_not_told_as_an_explanation():
    document = documents.described()
    assert headline(document).endswith("(described, not confirmed)")
    page = diagnose_html(document, {})
    assert "describes it" in page and "is the explanation" not in page
    assert 'class="verdict described"' in page
