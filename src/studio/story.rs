//! What decides the result of a session: its recipes, when each took over, and when it was ended.

use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use super::hex::hexadecimal;
use super::provenance::Provenances;

/// What decides the result of a session: its recipes, and when each took over.
#[derive(Clone, Debug)]
pub(super) struct Story {
    /// What the present recipe would make of the picture alone.
    present: Provenances,
    /// The evals at which each recipe took over, and the key of what it would make of the picture alone.
    recipes: Vec<Value>,
}

impl Story {
    /// The story of a session that begins with a recipe.
    pub fn begin(recipe: Provenances) -> Self {
        let recipes = vec![taken_over(0, &recipe)];
        Self { present: recipe, recipes }
    }

    /// Another recipe takes over after so many evals.
    pub fn go_on(&mut self, evals: u64, recipe: Provenances) {
        self.recipes.push(taken_over(evals, &recipe));
        self.present = recipe;
    }

    /// What decides the result; `until` is the number of evals at which the session is ended before its budget is.
    pub fn provenances(&self, until: Option<u64>) -> Provenances {
        let mut more = Map::new();
        if self.recipes.len() > 1 {
            let hash = hexadecimal(&Sha256::digest(Value::from(self.recipes.clone()).to_string()));
            more.insert("changes".to_owned(), json!({ "count": self.recipes.len() - 1, "sha256": hash }));
        }
        if let Some(evals) = until {
            more.insert("until".to_owned(), evals.into());
        }
        if more.is_empty() {
            return self.present.clone();
        }
        let Provenances { picture, population, target } = &self.present;
        Provenances { picture: picture.with(more.clone()), population: population.with(more), target: target.clone() }
    }
}

fn taken_over(evals: u64, recipe: &Provenances) -> Value {
    json!({ "evals": evals, "key": recipe.population.key() })
}
