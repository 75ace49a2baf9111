from curiosity_algos.experiments.report.configurations import configurations


def test_settings_that_differ_are_listed_by_label(maze):
    text = configurations(maze)
    assert '<th scope="row"><code>settings.batch_size</code></th><td>16</td>' in text
    assert "settings.n_parents" not in text  # where they have it, it is the same
    assert text.count("<pre") == len(maze.runs)
    assert "&quot;algorithm&quot;: &quot;NSES&quot;" in text


def test_settings_that_do_not_differ(mountain):
    assert "All runs have the same settings." in configurations(mountain)


def test_what_a_description_says_is_text(mountain):
    mountain.runs[0].description["settings"]["sigma"] = "<script>"
    assert "<script>" not in configurations(mountain)


def test_a_run_under_way_says_how_far_it_is(mountain):
    mountain.runs[0].result["total_timesteps"] = 3000
    assert "1.5k timesteps in" in configurations(mountain)
    assert "50.0\N{NO-BREAK SPACE}% done" in configurations(mountain)
