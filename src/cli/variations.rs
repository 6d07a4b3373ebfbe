//! `--vary KEY=A,B,C` and `--config NAME=KEY=VALUE,…`: which configurations they stand for.

use crate::error::{Error, Result};

/// One configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Variation {
    /// Its name, unique.
    pub(super) name: String,
    /// `path.to.key=value`, as for `--set`.
    pub(super) overrides: Vec<String>,
    /// Sample counts at which it is scored, if not at the powers of two.
    pub(super) checkpoints: Option<Vec<u64>>,
}

/// Most configurations: a slip in a product of lists is stopped before it takes all day.
const MAX_VARIATIONS: usize = 1000;

/// Every combination of `vary`, for each of `config`, or for the scene as it is if there is none.
pub(super) fn variations(vary: &[String], config: &[String]) -> Result<Vec<Variation>> {
    let mut all = Vec::new();
    for option in config {
        all.push(named(option)?);
    }
    if all.is_empty() {
        all.push((String::new(), Vec::new()));
    }
    for option in vary {
        let wrong = || Error::usage(format!("--vary {option}: must be written key=value,value"));
        let (key, values) = option.split_once('=').ok_or_else(wrong)?;
        let values = split(values);
        if key.trim().is_empty() || values.iter().any(|value| value.is_empty()) {
            return Err(wrong());
        }
        if all.len() * values.len() > MAX_VARIATIONS {
            return Err(Error::limit(format!(
                "more than {MAX_VARIATIONS} combinations"
            )));
        }
        let with = |(name, overrides): &(String, Vec<String>), value: &str| {
            let name = format!("{name} {}={value}", key.trim());
            let mut overrides = overrides.clone();
            overrides.push(full(key, value));
            (name.trim().to_owned(), overrides)
        };
        all = all
            .iter()
            .flat_map(|one| values.iter().map(move |value| with(one, value)))
            .collect();
    }
    let mut variations: Vec<Variation> = Vec::new();
    for (name, overrides) in all {
        let name = if name.is_empty() {
            "as it is".to_owned()
        } else {
            name
        };
        variations.push(Variation {
            name: unique(name, &variations),
            overrides,
            checkpoints: None,
        });
    }
    Ok(variations)
}

/// Whitted's method, and paths at 1, 100 and 400 samples per pixel.
pub(super) fn table_variations() -> Vec<Variation> {
    let variation = |name: &str, integrator: &str, checkpoints: &[u64]| Variation {
        name: name.to_owned(),
        overrides: vec![full("integrator", integrator)],
        checkpoints: Some(checkpoints.to_vec()),
    };
    vec![
        variation("Whitted", "whitted", &[1]),
        variation("Monte Carlo", "path", &[1, 100, 400]),
    ]
}

/// The name and the overrides of `NAME=key=value,key=value`; `NAME=` alone is the scene as it is.
fn named(option: &str) -> Result<(String, Vec<String>)> {
    let wrong = || {
        Error::usage(format!(
            "--config {option}: must be written name=key=value,key=value"
        ))
    };
    let (name, rest) = option.split_once('=').ok_or_else(wrong)?;
    if name.trim().is_empty() {
        return Err(wrong());
    }
    let assignments = split(rest).into_iter().filter(|text| !text.is_empty());
    let overrides = assignments
        .map(|text| {
            let (key, value) = text.split_once('=').ok_or_else(wrong)?;
            Ok(full(key, value))
        })
        .collect::<Result<_>>()?;
    Ok((name.trim().to_owned(), overrides))
}

/// `key=value`, a single word being a key of the table `[render]`.
fn full(key: &str, value: &str) -> String {
    let key = key.trim();
    let table = if key.contains('.') { "" } else { "render." };
    format!("{table}{key}={}", value.trim())
}

/// Parts of a text between commas that are in no bracket and no quotes.
fn split(text: &str) -> Vec<&str> {
    let (mut depth, mut quote, mut start) = (0usize, None, 0);
    let mut parts = Vec::new();
    for (at, character) in text.char_indices() {
        match (character, quote) {
            (c, Some(open)) if c == open => quote = None,
            (_, Some(_)) => {}
            ('"' | '\'', None) => quote = Some(character),
            ('[' | '{', None) => depth += 1,
            (']' | '}', None) => depth = depth.saturating_sub(1),
            (',', None) if depth == 0 => {
                parts.push(text[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(text[start..].trim());
    parts
}

/// The name, with a number if it is taken: the same settings twice are a test of the machine.
fn unique(name: String, taken: &[Variation]) -> String {
    let is_free = |name: &String| taken.iter().all(|other| other.name != *name);
    let numbered = (2..).map(|number| format!("{name} #{number}"));
    std::iter::once(name.clone())
        .chain(numbered)
        .find(is_free)
        .expect("the taken names are finitely many")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(vary: &[&str], config: &[&str]) -> Result<Vec<Variation>> {
        let owned =
            |texts: &[&str]| -> Vec<String> { texts.iter().map(|t| (*t).to_owned()).collect() };
        variations(&owned(vary), &owned(config))
    }

    fn names(variations: &[Variation]) -> Vec<&str> {
        variations
            .iter()
            .map(|variation| variation.name.as_str())
            .collect()
    }

    #[test]
    fn lists_make_every_combination_in_order() {
        let all = of(&["strategy=mis,nee", "materials.glass.ior=1.5,1.75"], &[]).unwrap();
        assert_eq!(
            names(&all),
            [
                "strategy=mis materials.glass.ior=1.5",
                "strategy=mis materials.glass.ior=1.75",
                "strategy=nee materials.glass.ior=1.5",
                "strategy=nee materials.glass.ior=1.75",
            ]
        );
        assert_eq!(
            all[1].overrides,
            ["render.strategy=mis", "materials.glass.ior=1.75"]
        );
    }

    #[test]
    fn named_configurations_are_varied_too_and_names_are_unique() {
        let all = of(&["accel=bvh2,bvh2"], &["plain=", "cut=max_depth=3,seed=1"]).unwrap();
        assert_eq!(
            names(&all),
            [
                "plain accel=bvh2",
                "plain accel=bvh2 #2",
                "cut accel=bvh2",
                "cut accel=bvh2 #2"
            ]
        );
        assert_eq!(
            all[2].overrides,
            ["render.max_depth=3", "render.seed=1", "render.accel=bvh2"]
        );
        assert_eq!(names(&of(&[], &[]).unwrap()), ["as it is"]);
    }

    #[test]
    fn commas_in_brackets_and_quotes_do_not_separate() {
        assert_eq!(
            split("[1, 2], [3, [4, 5]] ,\"a,b\""),
            ["[1, 2]", "[3, [4, 5]]", "\"a,b\""]
        );
        assert_eq!(split(""), [""]);
    }

    #[test]
    fn malformed_options_are_quoted_in_the_error() {
        for (vary, config) in [
            (vec!["strategy"], vec![]),
            (vec!["strategy="], vec![]),
            (vec!["strategy=mis,,nee"], vec![]),
            (vec!["=mis"], vec![]),
            (vec![], vec!["plain"]),
            (vec![], vec!["=strategy=mis"]),
            (vec![], vec!["a=strategy"]),
        ] {
            let message = of(&vary, &config).unwrap_err().message;
            let option = vary.first().or(config.first()).unwrap();
            assert!(message.contains(option), "{message}");
        }
        let wide = format!("seed={}", vec!["1"; 1001].join(","));
        assert!(of(&[&wide], &[]).is_err());
    }
}
