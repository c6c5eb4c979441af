import pytest

from passpmp_ti.cli import BAD_INPUT, main

COMMANDS = (
    ["run"], ["map"], ["attack"], ["faults"], ["verify"], ["bench"], ["bench", "cycle"],
    ["compare"], ["reproduce"], ["scenarios"], [],
)  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_shows_an_example(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([*command, "--help"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert "example" in told
    assert " ".join(["passpmp", *command]) in told.partition("example")[2]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "crowdet"], "did you mean 'crowded'"),
        (["run", "crowded", "--set", "partcles=3"], "did you mean 'particles'"),
        (["run", "crowded", "--set", "particles"], "field=value"),
        (["run", "crowded", "--cycle", "-1"], "Settings.cycle"),
        (["run", "crowded", "--object-speed", "-1"], ">= 0"),
        (["map", "crowded", "--speed", "99"], "beyond the robot's limit"),
    ],
)
def test_bad_input_is_refused_without_a_traceback(arguments, told, capsys):
    assert main(arguments) == BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith("passpmp: error: ")
    assert told in error
    assert "Traceback" not in error


def test_scenarios_are_listed_with_a_line_each(capsys):
    assert main(["scenarios"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("crowded ") and "22 movers" in line for line in lines)


def test_a_map_is_drawn_and_its_shares_printed(tmp_path, capsys):
    picture = tmp_path / "deep" / "map.png"
    assert main(["map", "dead_end", "--speed", "0.5", "--out", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "of what the scan saw" in capsys.readouterr().out


def test_a_run_ends_with_a_table(tmp_path, capsys):
    out = tmp_path / "out"
    scenario = tmp_path / "short.yaml"
    scenario.write_text(
        "description: a short drive in the open\nrobot: {type: differential}\n"
        "settings: {object_speed: 1.0}\nlidars: [{range_max: 8, beams: 360}]\n"
        "world: {bounds: [-5, -5, 5, 5]}\nstart: [0, 0, 0]\ngoals: [[1, 0]]\nduration: 1\n"
    )
    assert main(["run", str(scenario), "--seeds", "0-1", "--out", str(out), "--no-video"]) == 0
    told = capsys.readouterr().out
    assert "contacts while moving" in told
    assert "mean speed under way" in told
    assert (out / "seed-1" / "summary.json").exists()


def test_the_bench_tells_every_part(tmp_path, capsys):
    assert main(["bench", "cycle", "dead_end", "--cycles", "3",
                 "--json", str(tmp_path / "c.json")]) == 0
    told = capsys.readouterr().out
    for part in ("scan to trajectory", "model", "tree", "choice", "Taichi"):
        assert part in told
    assert (tmp_path / "c.json").exists()
