"""The device benchmark runs."""

from tests.benchmarks.bench_devices import measure


def test_it_measures_a_streaming_a_polled_and_a_hid_device():
    streaming, polled, hid = map(measure, ("viper", "ndi", "hydra"))
    assert min(f.parse_us for f in (streaming, polled, hid)) > 0
    assert streaming.latency_us is not None
    assert polled.latency_us is None
    assert hid.latency_us is None
