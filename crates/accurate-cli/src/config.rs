//! The config file: every option of every command, by its long name, under the command's name.
//!
//! Its keys, its schema and the effective config are read off the command line's own definition, so
//! they cannot drift apart from it.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use serde_json::{Map, Value, json};
use toml::{Table, Value as Toml};

use crate::args::is_switch;
use crate::code::Code;
use crate::failure::Failure;
use crate::text::read_text;

/// Options that make no sense in a file.
const NOT_IN_A_FILE: [&str; 4] = ["config", "help", "version", "json"];

/// Options that make no sense together.
const EXCLUSIVE: [&str; 2] = ["quiet", "verbose"];

/// The words of the command line with those of its `--config` file put in, behind the command that
/// they are for and before the user's own.
///
/// # Errors
/// A file that cannot be read, is not TOML, or has a key that is no option; two files.
pub fn expand(command: &Command, mut words: Vec<OsString>) -> Result<Vec<OsString>, Failure> {
    if config_paths(&words).nth(1).is_some() {
        return Err(Failure::new(Failure::USAGE, "--config is given twice")
            .with_hint("one file, with a table for each command: `accurate config schema`"));
    }
    let Some(path) = config_path(&words) else { return Ok(words) };
    let text = read_text(&path)?;
    let wrong = |problem: String| {
        Failure::new(Code::Malformed, format!("{}: {problem}", path.display()))
            .with_hint("`accurate config schema` lists every key")
    };
    let mut table: Table = text.parse().map_err(|e: toml::de::Error| wrong(e.to_string()))?;
    check(command, &table, "").map_err(wrong)?;
    let own: Vec<String> = words.iter().map(|w| w.to_string_lossy().into_owned()).collect();
    // Who says one of these does not mean the file's other one.
    if options(command).any(|arg| EXCLUSIVE.contains(&name(arg).as_str()) && is_given(arg, &own)) {
        EXCLUSIVE.iter().for_each(|key| {
            table.remove(*key);
        });
    }
    // The global options first, then the command's, then those of a command below it.
    let (mut here, mut insert_at) = (command, 1);
    loop {
        // Of an option that may be given several times, the user's own replace those of the file.
        for arg in options(here).filter(|arg| is_list(arg) && is_given(arg, &own)) {
            table.remove(&name(arg));
        }
        let below = next_command(here, &words, insert_at);
        // Such a command takes either options of its own or a command below it.
        let new = match below {
            Some(_) if here.is_args_conflicts_with_subcommands_set() => Vec::new(),
            _ => words_of(here, &table).map_err(wrong)?,
        };
        let count = new.len();
        words.splice(insert_at..insert_at, new);
        let Some((position, below)) = below.map(|(at, below)| (at + count, below)) else { break };
        table = match table.remove(below.get_name()) {
            Some(Toml::Table(inner)) => inner,
            _ => Table::new(),
        };
        (here, insert_at) = (below, position + 1);
    }
    Ok(words)
}

/// The options in effect, as a config file that gives the same run.
pub fn effective(command: &Command, matches: &ArgMatches) -> String {
    fn table_of(command: &Command, matches: &ArgMatches) -> Table {
        let mut table = Table::new();
        let own =
            matches.subcommand().is_none() || !command.is_args_conflicts_with_subcommands_set();
        for arg in options(command).filter(|_| own) {
            let id = arg.get_id().as_str();
            if matches.value_source(id).is_none() {
                continue;
            }
            let flag = is_switch(arg);
            let count = matches!(arg.get_action(), ArgAction::Count);
            let value = if flag {
                Toml::Boolean(matches.get_flag(id))
            } else if count {
                Toml::Integer(matches.get_count(id).into())
            } else {
                let words: Vec<String> = matches
                    .get_raw(id)
                    .into_iter()
                    .flatten()
                    .map(|raw| raw.to_string_lossy().into_owned())
                    .collect();
                match (words.as_slice(), is_list(arg)) {
                    ([], _) => continue,
                    ([one], false) => match one.parse::<i64>() {
                        Ok(number) if number.to_string() == *one => Toml::Integer(number),
                        // Also `007`, which may be a file.
                        _ => Toml::String(one.clone()),
                    },
                    _ => words.into(),
                }
            };
            // A default that says "off" is what leaving it out says.
            if matches.value_source(id) == Some(ValueSource::DefaultValue) && (flag || count) {
                continue;
            }
            table.insert(name(arg), value);
        }
        if let Some((below, inner)) = matches.subcommand()
            && let Some(below) = command.find_subcommand(below)
        {
            table.insert(below.get_name().to_owned(), Toml::Table(table_of(below, inner)));
        }
        table
    }
    toml::to_string(&table_of(command, matches)).unwrap_or_default()
}

/// The JSON schema of the config file.
pub fn schema(command: &Command) -> Value {
    fn object(command: &Command) -> Value {
        let mut properties = Map::new();
        for arg in options(command) {
            let mut property = match arg.get_action() {
                _ if is_switch(arg) => json!({"type": "boolean"}),
                ArgAction::Count => json!({"type": "integer", "minimum": 0}),
                _ => {
                    let names: Vec<String> =
                        arg.get_possible_values().iter().map(|v| v.get_name().to_owned()).collect();
                    let one = if names.is_empty() {
                        json!({"type": ["string", "number"]})
                    } else {
                        json!({"enum": names})
                    };
                    if is_list(arg) { json!({"type": "array", "items": one}) } else { one }
                }
            };
            if let Some(help) = arg.get_help() {
                property["description"] = Value::from(help.to_string());
            }
            properties.insert(name(arg), property);
        }
        for below in subcommands(command) {
            let mut inner = object(below);
            if let Some(about) = below.get_about() {
                inner["description"] = Value::from(about.to_string());
            }
            // A command may have the name of an option beside it: a table is the command's.
            let entry = properties.entry(below.get_name()).or_insert(Value::Null);
            *entry = match entry.take() {
                Value::Null => inner,
                option => json!({"anyOf": [option, inner]}),
            };
        }
        json!({"type": "object", "properties": properties, "additionalProperties": false})
    }
    let mut schema = object(command);
    schema["$schema"] = Value::from("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = Value::from("Config file of accurate");
    schema
}

pub fn config_path(words: &[OsString]) -> Option<PathBuf> {
    config_paths(words).next()
}

fn config_paths(words: &[OsString]) -> impl Iterator<Item = PathBuf> + '_ {
    words.iter().enumerate().skip(1).filter_map(|(at, word)| {
        let word = word.to_str()?;
        match word.strip_prefix("--config") {
            Some("") => words.get(at + 1).map(PathBuf::from),
            Some(rest) => rest.strip_prefix('=').map(PathBuf::from),
            None => None,
        }
    })
}

/// Where else a wrong option may stand.
pub fn counts_too(path: &Path) -> String {
    format!("what {} says counts as if it were typed", path.display())
}

/// Whether the words of a command line give an option, by its long or its short name.
fn is_given(arg: &Arg, words: &[String]) -> bool {
    words.iter().any(|word| match word.strip_prefix("--") {
        Some(long) => arg.get_long() == Some(long.split('=').next().unwrap_or(long)),
        None => word
            .strip_prefix('-')
            .and_then(|s| s.chars().next())
            .is_some_and(|short| arg.get_short() == Some(short)),
    })
}

/// The next word that names a command below `command`, from index `from` on.
fn next_command<'a>(
    command: &'a Command,
    words: &[OsString],
    from: usize,
) -> Option<(usize, &'a Command)> {
    let mut at = from;
    while let Some(word) = words.get(at) {
        let word = word.to_string_lossy();
        // Its value, if it takes one and has not got it with `=` or at once, is no command.
        let is_named = |arg: &Arg| match word.strip_prefix("--") {
            Some(long) => arg.get_long() == Some(long),
            None => arg.get_short().is_some_and(|short| word == format!("-{short}")),
        };
        if command.get_arguments().any(|arg| is_named(arg) && arg.get_action().takes_values()) {
            at += 1;
        } else if !word.starts_with('-') {
            return command.find_subcommand(&*word).map(|below| (at, below));
        }
        at += 1;
    }
    None
}

/// Refuses the first key that is neither an option nor a command.
fn check(command: &Command, table: &Table, path: &str) -> Result<(), String> {
    for (key, value) in table {
        if let (Some(below), Toml::Table(inner)) =
            (subcommands(command).find(|c| c.get_name() == key), value)
        {
            check(below, inner, &format!("{path}{key}."))?;
        } else if !options(command).any(|arg| name(arg) == *key) {
            let names = options(command)
                .map(name)
                .chain(subcommands(command).map(|c| c.get_name().to_owned()));
            let near = names
                .map(|n| (strsim::jaro_winkler(&n, key), n))
                .filter(|(likeness, n)| *likeness > 0.8 && n != key)
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let suggestion =
                near.map(|(_, n)| format!("; did you mean `{n}`?")).unwrap_or_default();
            return Err(format!("`{path}{key}` is no option{suggestion}"));
        }
    }
    Ok(())
}

/// What a command's own keys say, as words of a command line.
fn words_of(command: &Command, table: &Table) -> Result<Vec<OsString>, String> {
    let mut words = Vec::new();
    for arg in options(command) {
        let key = name(arg);
        let Some(value) = table.get(&key) else { continue };
        // The table of a command that has the name of an option.
        if value.is_table() && subcommands(command).any(|below| below.get_name() == key) {
            continue;
        }
        match (arg.get_action(), value) {
            (_, Toml::Boolean(on)) if is_switch(arg) => {
                words.extend(on.then(|| format!("--{key}").into()));
            }
            _ if is_switch(arg) => return Err(format!("`{key}` is true or false")),
            (ArgAction::Count, Toml::Integer(n @ 0..=9)) => {
                words.extend((0..*n).map(|_| OsString::from(format!("--{key}"))));
            }
            (ArgAction::Count, _) => return Err(format!("`{key}` is a whole number, 0 to 9")),
            (_, Toml::Array(items)) if is_list(arg) => {
                let items: Vec<String> =
                    items.iter().map(|item| scalar(&key, item)).collect::<Result<_, _>>()?;
                words.extend(words_of_list(arg, &items)?);
            }
            _ => words.push(format!("--{key}={}", scalar(&key, value)?).into()),
        }
    }
    Ok(words)
}

/// A list as the argument expects it: in one word where it splits words, in groups where it takes
/// several at once, else once for each.
fn words_of_list(arg: &Arg, items: &[String]) -> Result<Vec<OsString>, String> {
    let key = name(arg);
    if let Some(delimiter) = arg.get_value_delimiter() {
        return Ok(vec![format!("--{key}={}", items.join(&delimiter.to_string())).into()]);
    }
    let group = arg.get_num_args().map_or(1, |range| range.min_values());
    if group < 2 {
        return Ok(items.iter().map(|item| format!("--{key}={item}").into()).collect());
    }
    if !items.len().is_multiple_of(group) {
        return Err(format!("`{key}` takes {group} values at once, not {}", items.len()));
    }
    let words = items.chunks(group).flat_map(|values| {
        std::iter::once(format!("--{key}").into()).chain(values.iter().map(OsString::from))
    });
    Ok(words.collect())
}

fn scalar(key: &str, value: &Toml) -> Result<String, String> {
    match value {
        Toml::String(text) => Ok(text.clone()),
        Toml::Integer(n) => Ok(n.to_string()),
        Toml::Float(x) => Ok(x.to_string()),
        other => Err(format!("`{key}` cannot be {}", other.type_str())),
    }
}

fn options(command: &Command) -> impl Iterator<Item = &Arg> {
    command
        .get_arguments()
        .filter(|arg| arg.get_long().is_some_and(|long| !NOT_IN_A_FILE.contains(&long)))
}

/// The commands below a command that a user sees.
pub fn subcommands(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|below| !below.is_hide_set() && below.get_name() != "help")
}

fn name(arg: &Arg) -> String {
    arg.get_long().unwrap_or_default().to_owned()
}

fn is_list(arg: &Arg) -> bool {
    arg.get_value_delimiter().is_some() || matches!(arg.get_action(), ArgAction::Append)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::command_line;

    fn expanded(config: &str, words: &[&str]) -> Result<Vec<String>, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("accurate.toml");
        std::fs::write(&path, config).unwrap();
        let mut all: Vec<OsString> = vec!["accurate".into(), "--config".into(), path.into()];
        all.extend(words.iter().map(OsString::from));
        expand(&command_line(), all)
            .map(|words| {
                let words = words.iter().map(|w| w.to_string_lossy().into_owned());
                words.filter(|w| !w.contains("accurate")).collect()
            })
            .map_err(|failure| failure.to_string())
    }

    #[test]
    fn the_users_words_come_after_those_of_the_file() {
        let config = "threads = 2\n[reconstruct]\ninput = \"mask\"\nstrict = true\nalso = [\"ply\", \"npy\"]\n[table]\ncases = 3\n";
        let words = expanded(config, &["reconstruct", "pair", "--input", "points"]).unwrap();
        let at = |word: &str| words.iter().position(|w| w == word).unwrap();
        assert!(at("--threads=2") < at("reconstruct"));
        assert!(at("reconstruct") < at("--input=mask"));
        assert!(at("--input=mask") < at("--input"));
        assert!(at("--strict") < at("pair") && at("--also=ply,npy") < at("pair"));
        assert!(!words.iter().any(|w| w.contains("cases")));
    }

    #[test]
    fn a_switch_of_the_file_is_turned_off_by_its_value() {
        let config = "quiet = true\n[reconstruct]\nstrict = true\nrefine-calibration = true\n";
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("accurate.toml");
        std::fs::write(&path, config).unwrap();
        let switches = |own: &[&str]| {
            let mut words: Vec<OsString> =
                vec!["accurate".into(), "--config".into(), (&path).into()];
            words.extend(own.iter().map(OsString::from));
            words.extend(["-o", "out", "-i", "mask"].map(OsString::from));
            let words = expand(&command_line(), words).unwrap();
            let matches = command_line().try_get_matches_from(words).unwrap();
            let below = matches.subcommand_matches("reconstruct").unwrap();
            let folder = below.get_raw("inputs").unwrap().next().unwrap().to_owned();
            assert_eq!(folder, "pair", "a switch takes no word of its own");
            (
                matches.get_flag("quiet"),
                ["strict", "refine_calibration"].map(|id| below.get_flag(id)),
            )
        };
        assert_eq!(switches(&["reconstruct", "pair"]), (true, [true, true]));
        assert_eq!(switches(&["reconstruct", "--strict=false", "pair"]), (true, [false, true]));
        assert_eq!(
            switches(&["-vv", "reconstruct", "--strict", "pair", "--refine-calibration=false"]),
            (false, [true, false])
        );
        assert_eq!(
            switches(&["reconstruct", "--quiet=false", "--strict=true", "pair"]),
            (false, [true, true])
        );
    }

    #[test]
    fn an_unknown_key_is_refused_with_the_nearest_name() {
        let error = expanded("[reconstruct]\nmethd = \"paper\"\n", &["demo"]).unwrap_err();
        assert!(error.contains("reconstruct.methd"), "{error}");
        assert!(error.contains("did you mean `method`"), "{error}");
    }

    #[test]
    fn the_schema_knows_every_command_and_its_options() {
        let schema = schema(&command_line());
        let reconstruct = &schema["properties"]["reconstruct"]["properties"];
        assert_eq!(reconstruct["strict"]["type"], "boolean");
        assert_eq!(reconstruct["also"]["type"], "array");
        assert!(schema["properties"]["threads"].is_object());
    }

    #[test]
    fn the_effective_config_gives_the_same_run() {
        let words = ["accurate", "--threads", "2", "table", "--cases", "3", "--seeds", "1,2"];
        let command = command_line();
        let matches = command.clone().try_get_matches_from(words).unwrap();
        let config = effective(&command, &matches);
        let again = expanded(&config, &["table"]).unwrap();
        assert!(again.contains(&"--cases=3".to_owned()), "{again:?}");
        assert!(again.contains(&"--seeds=1,2".to_owned()), "{again:?}");
        assert!(again.contains(&"--threads=2".to_owned()), "{again:?}");
    }

    /// What a saved config and the words that no file holds are parsed to, as a config again.
    fn again(words: &[&str], positional: &[&str]) -> (String, String) {
        let command = command_line();
        let parse = |words: Vec<OsString>| {
            let matches = command.clone().try_get_matches_from(words).unwrap();
            effective(&command, &matches)
        };
        let config = parse(words.iter().map(OsString::from).collect());
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("config.toml");
        std::fs::write(&path, &config).unwrap();
        let mut all: Vec<OsString> = vec!["accurate".into(), "--config".into(), path.into()];
        all.extend(positional.iter().map(OsString::from));
        (config.clone(), parse(expand(&command, all).unwrap()))
    }

    #[test]
    fn lists_come_back_as_they_were() {
        let reconstruct = "accurate reconstruct x -i mask -o a,b -o b.vtp --cameras l.yml \
                           --cameras r.yml --frame 0 --frame 7 --also ply,npy --truth 007";
        let doctor = "accurate camera doctor rig.toml --masks a b --masks c d --views l,r";
        let xray = "accurate synth xray --sheet s.png --size 64 -n 3";
        for (words, positional) in [
            (reconstruct, &["reconstruct", "x"][..]),
            (doctor, &["camera", "doctor", "rig.toml"]),
            (xray, &["synth", "xray"]),
            ("accurate synth easy --xray -o xray", &["synth", "easy"]),
        ] {
            let words: Vec<&str> = words.split_whitespace().collect();
            let (config, again) = again(&words, positional);
            assert_eq!(config, again);
            assert!(config.lines().count() > 3, "{config}");
        }
    }

    #[test]
    fn an_empty_list_is_a_list() {
        let words = "accurate model import x -o y --mirror-axes=".split(' ').collect::<Vec<_>>();
        let (config, again) = again(&words, &["model", "import", "x"]);
        assert_eq!(config, again);
        assert!(config.contains("mirror-axes = [\"\"]"), "{config}");
        let words = expanded("[model.import]\nmirror-axes = []\n", &["model", "import", "x"]);
        assert!(words.unwrap().contains(&"--mirror-axes=".to_owned()));
    }

    #[test]
    fn values_that_do_not_fill_their_groups_are_refused() {
        let config = "[camera.doctor]\nmasks = [\"a.png\"]\n";
        let error = expanded(config, &["camera", "doctor", "rig.toml"]).unwrap_err();
        assert!(error.contains("`masks` takes 2 values at once"), "{error}");
    }

    #[test]
    fn an_option_and_a_command_of_one_name_are_told_apart() {
        let config = "[synth]\nxray = true\ncount = 3\n";
        let words = expanded(config, &["synth", "-o", "xray", "easy"]).unwrap();
        assert!(words.contains(&"--xray".to_owned()), "{words:?}");
        let config = "[synth]\ncount = 3\n[synth.xray]\nsheet = \"s.png\"\n";
        let words = expanded(config, &["synth", "xray"]).unwrap();
        assert!(words.ends_with(&["xray".to_owned(), "--sheet=s.png".to_owned()]), "{words:?}");
        assert!(!words.contains(&"--count=3".to_owned()), "{words:?}");
        let schema = schema(&command_line());
        let both = &schema["properties"]["synth"]["properties"]["xray"]["anyOf"];
        assert_eq!((&both[0]["type"], &both[1]["type"]), (&"boolean".into(), &"object".into()));
    }
}
