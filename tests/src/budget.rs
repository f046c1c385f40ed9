//! What the boards may take at run time: `budgets/tick.toml` and `budgets/rig.toml`.
//!
//! What it is: the comparison of instructions that the emulated boards' tests share, with both numbers printed, and the rig board's limits.
//! What can go wrong: a budget of instructions that is far above the figure hides growth, and is refused like one that is exceeded.
//! Units: instructions; cycles and bytes as `budgets/rig.toml` says.
//! Reference: house rule 8.

/// Compares what was `measured` with the budget `key` of `[board]`; `available` is what the tick has.
///
/// # Panics
/// When the budget is exceeded, slack, or not there.
pub fn judge_tick(board: &str, key: &str, measured: f64, available: f64) {
    let text = include_str!("../../budgets/tick.toml");
    let table: toml::Table = text.parse().unwrap_or_else(|e| panic!("budgets/tick.toml: {e}"));
    let budget = table.get(board).and_then(|t| t.get(key)).and_then(toml::Value::as_integer);
    let budget = budget.unwrap_or_else(|| panic!("budgets/tick.toml: {board}.{key} is not a number")) as f64;
    println!(
        "{board}, {key}: {measured:.1} instructions a tick, budget {budget}, {:.1} % of the tick",
        100.0 * measured / available
    );
    assert!(measured <= budget, "{board}, {key}: {measured:.1} instructions a tick exceed the {budget} of budgets/tick.toml");
    assert!(measured > 0.7 * budget, "{board}, {key}: the budget {budget} is slack, write {measured:.0} plus 2 %");
}

/// An upper limit of the rig board at run time: `key` of `budgets/rig.toml`.
///
/// # Panics
/// When it is not there or no whole number.
#[must_use]
pub fn rig(key: &str) -> u32 {
    let text = include_str!("../../budgets/rig.toml");
    let table: toml::Table = text.parse().unwrap_or_else(|e| panic!("budgets/rig.toml: {e}"));
    let limit = table.get(key).and_then(toml::Value::as_integer).and_then(|v| u32::try_from(v).ok());
    limit.unwrap_or_else(|| panic!("budgets/rig.toml: {key} is not a whole number"))
}
