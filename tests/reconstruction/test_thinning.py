import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.thinning import thinned, thinned_reference


@given(
    st.lists(st.integers(0, 60), max_size=60),
    st.integers(1, 6),
    st.integers(1, 40),
)
def test_the_kernel_agrees_with_the_plain_rule(found, apart, count):
    rows = np.array(found, np.int64)
    clips = rows // 25
    kept = thinned(rows, clips, apart, count)
    assert kept.tolist() == thinned_reference(rows, clips, apart, count)
    assert len(kept) <= count
    for place, number in enumerate(kept):
        others = np.delete(kept, place)
        assert not np.any((clips[others] == clips[number]) & (abs(rows[others] - rows[number]) < apart))
