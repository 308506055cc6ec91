from __future__ import annotations

import numpy as np
import pytest

from cadpose.library.contact_sheet import contact_sheet
from cadpose.records import CadModel


def test_pictures_stand_in_rows_with_names() -> None:
    entries = [
        (
            CadModel(f"a/b/m{i}.obj", "A very long name that cannot fit below its picture", "chair"),
            np.full((40, 60, 3), 20 * i, dtype=np.uint8),
        )
        for i in range(5)
    ]
    sheet = np.asarray(contact_sheet(entries, columns=3, title="Chairs"))
    height, width = sheet.shape[:2]
    assert width == 3 * 68
    for i, (_, picture) in enumerate(entries):
        block = sheet[:, (i % 3) * 68 + 4 : (i % 3) * 68 + 64]
        rows = (block == picture[0, 0]).all(axis=(1, 2))
        assert rows.sum() == 40
        assert (np.flatnonzero(rows)[0] > height // 2) == (i >= 3)
    # The names are cut to the picture's width: the gaps between columns stay white.
    assert (sheet[:, 66:70] == 255).all()


def test_nothing_to_show() -> None:
    with pytest.raises(ValueError, match="at least one"):
        contact_sheet([])
    with pytest.raises(ValueError, match="uint8"):
        contact_sheet([(CadModel("a", "a", "b"), np.zeros((4, 4), dtype=np.uint8))])
