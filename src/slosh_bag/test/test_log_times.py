from slosh_bag.nodes.arrivals import LogTimes

S = 1_000_000_000
START = 1_800_000_000 * S


def test_an_even_clock_is_taken_as_it_is():
    times = LogTimes(START, 7)
    for k in range(1, 50):
        times.look(START + k * S + 30_000_000 * (k % 2), 7 + k * S)  # and what is slewed
        assert times.of(START + k * S) == START + k * S


def test_set_back_the_times_go_on_until_the_clock_is_there_again():
    times = LogTimes(START, 0)
    times.look(START + S - 3600 * S, S)
    # The first came before the step, in the same batch.
    assert times.of(START + S // 2) == START + S // 2
    assert times.of(START + S - 3600 * S) == START + S
    times.look(START + 2 * S - 3600 * S, 2 * S)
    assert times.of(START + 2 * S - 3600 * S) == START + 2 * S
    times.look(START + 3 * S, 3 * S)
    assert times.of(START + 3 * S) == START + 3 * S
    times.look(START + 4 * S + 3600 * S, 4 * S)
    assert times.of(START + 4 * S + 3600 * S) == START + 4 * S + 3600 * S


def test_a_step_forward_makes_up_for_a_part_of_one_back():
    times = LogTimes(START, 0)
    times.look(START + S - 100 * S, S)
    times.look(START + 2 * S - 40 * S, 2 * S)
    assert times.of(START + 2 * S - 40 * S) == START + 2 * S


def test_none_is_before_the_one_written_before_it():
    times = LogTimes(START, 0)
    assert [times.in_order(time) for time in (5, 9, 7, 9, 10)] == [5, 9, 9, 9, 10]
