//! Options by name.

use super::options::plain;
use super::{Config, ConfigError};

/// The two sides of `key=value`; text needs no quotes.
pub(super) fn parse_assignment(assignment: &str) -> Result<(&str, toml::Value), ConfigError> {
    let (key, value) = assignment.split_once('=').ok_or_else(|| ConfigError::NotAnAssignment(assignment.to_owned()))?;
    let (key, value) = (key.trim(), value.trim());
    let parsed = toml::from_str::<toml::Table>(&format!("value = {value}")).ok();
    Ok((key, parsed.and_then(|mut table| table.remove("value")).unwrap_or_else(|| value.into())))
}

impl Config {
    /// Replaces one option by `key=value`; text needs no quotes.
    ///
    /// # Errors
    /// [`ConfigError`] that names the nearest key where there is none of that name.
    pub fn set(&mut self, assignment: &str) -> Result<(), ConfigError> {
        let (key, value) = parse_assignment(assignment)?;
        self.replace(key, value)
    }

    /// Replaces one option; a whole number is welcome where a fraction is expected.
    ///
    /// # Errors
    /// [`ConfigError::UnknownKey`] and [`ConfigError::BadValue`]; nothing is replaced then.
    pub(super) fn replace(&mut self, key: &str, value: toml::Value) -> Result<(), ConfigError> {
        let mut table = self.options();
        if !table.contains_key(key) {
            let similarity = |name: &&String| (strsim::jaro_winkler(name, key) * 1e6) as u64;
            let nearest = table.keys().max_by_key(similarity).cloned().unwrap_or_default();
            return Err(ConfigError::UnknownKey { key: key.to_owned(), nearest });
        }
        let shown = plain(&value);
        let value = match (&table[key], value) {
            (toml::Value::Float(_), toml::Value::Integer(whole)) => toml::Value::Float(whole as f64),
            (_, value) => value,
        };
        table.insert(key.to_owned(), value);
        *self = table.try_into().map_err(|error: toml::de::Error| ConfigError::BadValue {
            key: key.to_owned(),
            value: shown,
            reason: error.message().to_owned(),
        })?;
        Ok(())
    }

    /// All options by name, as `config.toml` holds them.
    pub fn options(&self) -> toml::Table {
        // Numbers, names and flags: nothing in it that TOML could not say.
        toml::Table::try_from(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use crate::actor::PolicyGradient;
    use crate::config::Preset;

    #[test]
    fn options_are_set_by_name() {
        let mut config = Preset::Paper.config("ball-run", 5.0);
        config.set("eta=2").unwrap();
        config.set("policy_gradient = one_step").unwrap();
        config.set("normalize_states=true").unwrap();
        assert_eq!((config.eta, config.policy_gradient, config.normalize_states), (2.0, PolicyGradient::OneStep, true));
    }

    #[test]
    fn an_unknown_option_names_the_nearest() {
        let error = Preset::Paper.config("ball-run", 5.0).set("actor_lr=1").unwrap_err();
        assert_eq!(error.to_string(), "there is no option `actor_lr`; did you mean `actor_rate`?");
    }

    #[test]
    fn a_bad_assignment_is_refused_and_changes_nothing() {
        let mut config = Preset::Paper.config("ball-run", 5.0);
        let before = config.clone();
        for bad in ["eta", "eta=high", "batch=-3", "policy_gradient=half"] {
            assert!(config.set(bad).is_err(), "{bad}");
        }
        assert_eq!(config, before);
    }
}
