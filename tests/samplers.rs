//! Experiments on samplers as a user writes them: files and commands.

use serde_json::Value;

use super::work::Work;

const FILE: &str = r#"name = "x"
samples = 20000
[setting.more]
samples = 30000
[[sampler]]
name = "hg"
henyey_greenstein = { g = 0.5 }
[[claim]]
sampler = { samplers = ["hg"] }
"#;

#[test]
fn files_are_held_to_their_schema() {
    for (old, new, place, words) in [
        ("samples", "sampels", "x.toml:2:1", "did you mean `samples`?"),
        ("samples = 20000", "samples = 999", "x.toml:2:11", "must be at least 1000, is 999"),
        ("samples = 20000", "samples = 20000000000", "x.toml:2:11", "must be at most 10000000000"),
        ("samples = 20000", "samples = 20000\nseeds = 1", "x.toml:3:1", "unknown key `seeds`"),
        ("samples = 20000\n", "", "x.toml:1:1", "missing key `samples`"),
        ("samples = 20000", "samples = 20000\npair.over = []", "x.toml:3:1", "belongs to a scene"),
        ("sampler = {", "equals = { value = 1, source = \"\" } #", "x.toml:8:1", "there are none"),
        ("\"hg\"\nh", "\"h/g\"\nh", "x.toml:6:8", "the name \"h/g\" contains '/'"),
        ("henyey_greenstein", "henyey_grenstein", "x.toml:7:1", "did you mean `henyey_greenstein`?"),
        ("{ g = 0.5 }", "{ g = 2 }", "x.toml:7:27", "must be at most 0.9999, is 2"),
        ("{ g = 0.5 }", "{ gg = 2 }", "x.toml:7:23", "unknown key `gg`"),
        ("[\"hg\"]", "[\"hgg\"]", "x.toml:9:25", "did you mean `hg`?"),
        ("[\"hg\"]", "[\"hg\", \"hg\"]", "x.toml:9:31", "`hg` occurs twice"),
        ("{ samplers = [\"hg\"] }", "{ detect = 0 }", "x.toml:9:22", "must be greater than 0"),
        (
            "[[claim]]",
            "[[sampler]]\nname = \"hg\"\nhenyey_greenstein = { g = 0 }\n[[claim]]",
            "x.toml:9:8",
            "two samplers are named `hg`",
        ),
    ] {
        let work = Work::with(&super::work::replaced(FILE, old, new));
        work.run("check x.toml").exits(2).complains(place).complains(words);
    }
    let work = Work::with(FILE);
    work.run("check x.toml").exits(0).says("x.toml: ok, 1 sampler, 20000 draws each, 1 claim");
    work.run("check x.toml --setting none").exits(2).complains("unknown setting `none`");
}

#[test]
fn every_command_handles_samplers() {
    let work = Work::with(FILE);
    work.run("list samplers").exits(0).says("henyey_greenstein").says("g  Mean cosine");
    work.run("plan x.toml --dry --setting more").exits(0).says("1 sampler, 30000 draws each");
    work.run("run x.toml -q --set samples=25000").exits(0).says("25000").says("report: ");
    let ran = work.run("verify x.toml -q --setting more --verbose");
    ran.exits(0).says("chi2 coarse").says("identity D7").says("verdicts are green");
    work.run("report results/x").exits(0);
    let page = work.read("results/x/report.md");
    assert!(page.contains("## Samplers") && page.contains("chi2 coarse"), "{page}");
    let schema = work.run("schema").exits(0).stdout();
    let schema: Value = serde_json::from_str(&schema).expect("JSON");
    let entry = &schema["$defs"]["SamplerEntry"]["properties"]["henyey_greenstein"];
    assert!(entry.is_object() && schema["else"]["dependentRequired"]["sampler"].is_array());
}
