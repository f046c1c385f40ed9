//! Who calls whom in a flash image: no panic in the control loop, and a bound on the stack.
//!
//! What it is: every function that the interrupts can reach, found in the ELF file itself, instruction by instruction; the deepest
//! stack of each root; the sum over the priorities that can nest.
//!
//! What can go wrong: a way to the panic handler, a recursion, or a call through a register in the control loop: each fails with
//! the chain of functions that leads there.
//!
//! Units: bytes.
//!
//! Reference: ARMv7-M: an exception pushes 8 words, 26 with floating-point state, and may align by one; AAELF32 mapping symbols.

use crate::run::Failure;
use crate::thumb::{Effect, decode};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What one exception entry takes: 26 words and the alignment.
const EXCEPTION: u32 = 27 * 4;

/// A function of the image.
#[derive(Debug, Default, Clone)]
struct Function {
    name: String,
    end: u32,
    calls: BTreeSet<u32>,
    indirect: bool,
    frame: u32,
}

/// The image's functions by address.
#[derive(Debug)]
pub(crate) struct Graph(BTreeMap<u32, Function>);

/// What a root reaches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Reach {
    /// Functions, the root included.
    pub(crate) functions: usize,
    /// Deepest stack below the root, its own frame included.
    pub(crate) stack: u32,
}

impl Graph {
    /// Reads the image.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let wrong = |e: &dyn std::fmt::Display| Failure(format!("{}: {e}", path.display()));
        let bytes = std::fs::read(path).map_err(|e| wrong(&e))?;
        let file = object::File::parse(&*bytes).map_err(|e| wrong(&e))?;
        let (mut functions, mut marks) = (BTreeMap::<u32, Function>::new(), BTreeMap::<u32, bool>::new());
        for symbol in file.symbols() {
            let (Ok(name), address) = (symbol.name(), symbol.address() as u32) else { continue };
            if name.starts_with("$d") || name.starts_with("$t") {
                let code = name.starts_with("$t");
                marks.entry(address).and_modify(|c| *c |= code).or_insert(code);
            } else if symbol.kind() == SymbolKind::Text && symbol.size() > 0 {
                let start = address & !1;
                let function = functions.entry(start).or_default();
                // several names of one body: the shortest is the plain one of a handler
                if function.name.is_empty() || name.len() < function.name.len() {
                    function.name = name.to_owned();
                }
                function.end = function.end.max(start + symbol.size() as u32);
            }
        }
        let mut graph = Self(functions);
        for section in file.sections().filter(|s| s.kind() == object::SectionKind::Text || s.name() == Ok(".data")) {
            let (base, data) = (section.address() as u32, section.data().map_err(|e| wrong(&e))?);
            graph.walk(base, data, &marks);
        }
        Ok(graph)
    }

    fn walk(&mut self, base: u32, data: &[u8], marks: &BTreeMap<u32, bool>) {
        let starts: Vec<u32> = self.0.range(base..base.saturating_add(data.len() as u32)).map(|(s, _)| *s).collect();
        let half = |at: u32| {
            let i = at.wrapping_sub(base) as usize;
            data.get(i..i + 2).map_or(0, |b| u16::from_le_bytes([b[0], b[1]]))
        };
        for start in starts {
            let end = self.0[&start].end;
            let mut found = Function::default();
            let mut at = start;
            while at < end {
                if !marks.range(..=at).next_back().is_none_or(|(_, code)| *code) {
                    at += 2; // a table or a constant among the code
                    continue;
                }
                let (length, effect) = decode(at, half(at), half(at + 2));
                match effect {
                    Effect::To(target) if !(start..end).contains(&target) => {
                        found.calls.insert(target);
                    }
                    Effect::Indirect => found.indirect = true,
                    Effect::Push(bytes) => found.frame += bytes,
                    _ => {}
                }
                at += length;
            }
            if let Some(function) = self.0.get_mut(&start) {
                (function.calls, function.indirect, function.frame) = (found.calls, found.indirect, found.frame);
            }
        }
    }

    fn named(&self, name: &str) -> Option<u32> {
        self.0.iter().find(|(_, f)| f.name == name).map(|(a, _)| *a)
    }

    /// Function that an address lies in.
    fn holding(&self, address: u32) -> Option<u32> {
        self.0.range(..=address).next_back().filter(|(_, f)| address < f.end).map(|(start, _)| *start)
    }

    /// Everything that `root` reaches. In a `strict` root no way may lead to a panic or through a register.
    pub(crate) fn reach(&self, root: &str, strict: bool) -> Result<Reach, Failure> {
        let start = self.named(root).ok_or_else(|| Failure(format!("the image has no function {root}")))?;
        let mut depth = BTreeMap::new();
        let mut chain = Vec::new();
        let stack = self.descend(start, strict, &mut chain, &mut depth)?;
        Ok(Reach { functions: depth.len(), stack })
    }

    /// No way from `at` leads to the log.
    fn never_logs(&self, at: u32, chain: &mut Vec<u32>, seen: &mut BTreeSet<u32>) -> Result<(), Failure> {
        let Some(function) = self.0.get(&at).filter(|_| seen.insert(at)) else { return Ok(()) };
        if is_logger(&function.name) {
            return Err(Failure(format!("a way to the log: {}", self.chain(chain, &function.name))));
        }
        chain.push(at);
        for target in function.calls.iter().filter_map(|call| self.holding(*call)) {
            self.never_logs(target, chain, seen)?;
        }
        chain.pop();
        Ok(())
    }

    fn chain(&self, chain: &[u32], last: &str) -> String {
        let names: Vec<&str> = chain.iter().map(|a| self.0[a].name.as_str()).chain([last]).collect();
        names.join(" -> ")
    }

    fn descend(&self, at: u32, strict: bool, chain: &mut Vec<u32>, depth: &mut BTreeMap<u32, u32>) -> Result<u32, Failure> {
        if let Some(known) = depth.get(&at) {
            return Ok(*known);
        }
        let function = &self.0[&at];
        if chain.contains(&at) {
            return Err(Failure(format!("recursion: {}", self.chain(chain, &function.name))));
        }
        if strict && (function.name.contains("panicking") || function.name.contains("rust_begin_unwind")) {
            return Err(Failure(format!("a way to a panic: {}", self.chain(chain, &function.name))));
        }
        if strict && function.indirect {
            return Err(Failure(format!("a call through a register: {}", self.chain(chain, &function.name))));
        }
        chain.push(at);
        let mut deepest = 0;
        for call in &function.calls {
            let Some(target) = self.holding(*call) else {
                return Err(Failure(format!("a call to nowhere ({call:#x}): {}", self.chain(chain, "?"))));
            };
            deepest = deepest.max(self.descend(target, strict, chain, depth)?);
        }
        chain.pop();
        depth.insert(at, function.frame + deepest);
        Ok(function.frame + deepest)
    }
}

/// Whether the image holds a message that is no error: defmt keeps each as a symbol that says its level.
fn informs(path: &Path) -> Result<bool, Failure> {
    let wrong = |e: &dyn std::fmt::Display| Failure(format!("{}: {e}", path.display()));
    let bytes = std::fs::read(path).map_err(|e| wrong(&e))?;
    let file = object::File::parse(&*bytes).map_err(|e| wrong(&e))?;
    Ok(file.symbols().any(|symbol| symbol.name().is_ok_and(|name| name.contains("\"tag\":\"defmt_info\""))))
}

/// Whether a function is the log's beginning of a frame, by which every message goes (defmt's own interface to its logger).
fn is_logger(name: &str) -> bool {
    name == "_defmt_acquire"
}

/// Both images log, but never from an interrupt: encoding a message takes its time with interrupts off.
pub(crate) fn quiet(path: &Path, roots: &[&str]) -> Result<(), Failure> {
    let graph = Graph::read(path)?;
    if !informs(path)? {
        return Err(Failure(format!("{}: holds no log of its own: is DEFMT_LOG set (.cargo/config.toml)?", path.display())));
    }
    for root in roots {
        let start = graph.named(root).ok_or_else(|| Failure(format!("{}: no function {root}", path.display())))?;
        graph.never_logs(start, &mut Vec::new(), &mut BTreeSet::new())?;
    }
    println!("{}: logs, and never from {}", path.file_name().unwrap_or_default().to_string_lossy(), roots.join(", "));
    Ok(())
}

/// Where the rig board's code begins: the last three interrupt with one priority, above the tick's.
const ROOTS: [(&str, bool, &str); 5] = [
    ("main", false, "start and idle"),
    ("TIM4", true, "control tick"),
    ("TIM2", true, "captures"),
    ("TIM1_CC", true, "back-EMF meter"),
    ("USART3", true, "ESC telemetry"),
];

/// Checks the rig board's image and prints what was found; gives the bound on its stack.
pub(crate) fn rig(path: &Path) -> Result<u32, Failure> {
    let graph = Graph::read(path)?;
    let (mut bound, mut highest) = (0, 0);
    for (root, strict, what) in ROOTS {
        let reach = graph.reach(root, strict)?;
        let found = if strict { "no panic, no call through a register" } else { "" };
        println!(
            "firmware-rig {root:<7} {what:<15} {:>4} functions, {:>5} bytes of stack  {found}",
            reach.functions, reach.stack
        );
        match root {
            "main" => bound += reach.stack,
            "TIM4" => bound += reach.stack + EXCEPTION,
            _ => highest = highest.max(reach.stack + EXCEPTION),
        }
    }
    bound += highest;
    println!("firmware-rig stack: at most {bound} bytes with interrupts of both priorities nested over the idle loop");
    Ok(bound)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(list: &[(u32, &str, &[u32], u32)]) -> Graph {
        let function = |(start, name, calls, frame): &(u32, &str, &[u32], u32)| {
            let calls = calls.iter().copied().collect();
            (*start, Function { name: (*name).to_owned(), end: start + 16, calls, indirect: *name == "table", frame: *frame })
        };
        Graph(list.iter().map(function).collect())
    }

    #[test]
    fn the_deepest_way_counts_and_a_tail_into_the_middle_is_a_call() {
        let g = graph(&[(0, "TIM4", &[16, 34], 8), (16, "a", &[32], 20), (32, "b", &[], 100)]);
        assert_eq!(g.reach("TIM4", true).unwrap(), Reach { functions: 3, stack: 128 });
    }

    #[test]
    fn forbidden_ways_are_named_with_their_chain() {
        let g = graph(&[(0, "TIM4", &[16], 0), (16, "a", &[32], 0), (32, "_ZN4core9panicking5panic17h0E", &[], 0)]);
        let failure = g.reach("TIM4", true).unwrap_err().to_string();
        assert!(failure.contains("TIM4 -> a -> _ZN4core9panicking"), "{failure}");
        assert!(g.reach("TIM4", false).is_ok());
        let g = graph(&[(0, "TIM4", &[16], 0), (16, "table", &[], 0)]);
        assert!(g.reach("TIM4", true).unwrap_err().to_string().contains("through a register"));
        let g = graph(&[(0, "TIM4", &[16], 0), (16, "a", &[0], 0)]);
        assert!(g.reach("TIM4", true).unwrap_err().to_string().contains("recursion"));
        assert!(g.reach("TIM9", true).unwrap_err().to_string().contains("no function TIM9"));
    }

    #[test]
    fn a_way_to_the_log_is_found_round_every_corner() {
        let g = graph(&[(0, "TIM4", &[16, 48], 0), (16, "a", &[0, 32], 0), (32, "_defmt_acquire", &[], 0), (48, "b", &[], 0)]);
        let ask = |root: &str| g.never_logs(g.named(root).unwrap(), &mut Vec::new(), &mut BTreeSet::new());
        let failure = ask("TIM4").unwrap_err().to_string();
        assert!(failure.contains("TIM4 -> a -> _defmt_acquire"), "{failure}");
        assert!(ask("b").is_ok());
    }
}
