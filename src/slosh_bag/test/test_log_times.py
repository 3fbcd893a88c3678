from slosh_bag.nodes.recorder_node import LogTimes

S = 1_000_000_000
START = 1_800_000_000 * S


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
