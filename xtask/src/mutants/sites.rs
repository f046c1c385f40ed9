//! Where in a source a mutant can be switched on.
//!
//! What it is: the operators, arms, guards and filled-up structs of a file, each with the text that a switch may stand around.
//!
//! What can go wrong: what the compiler works out by itself (constants, lengths, patterns) holds no switch; it is left out.
//!
//! Units: bytes from the start of a file.
//!
//! Reference: The Rust Reference, "Expression precedence".

use super::listed::{Genre, Lines};
use proc_macro2::Span;
use std::collections::BTreeMap;
use std::mem;
use std::ops::Range;
use syn::spanned::Spanned as _;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr};

/// A binary expression.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    pub(super) range: Range<usize>,
    /// The higher, the tighter.
    pub(super) weight: u8,
    /// A `let` is among the operands: it cannot leave its condition.
    pub(super) lets: bool,
}

/// What a switch may stand around.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Site {
    /// A binary expression, the last, and those that hold it without brackets, the outermost first.
    Chain(Vec<Link>),
    /// This text.
    Whole(Range<usize>),
    /// Behind the pattern of an arm.
    Behind(usize),
}

/// The sites of a file.
#[derive(Debug, Default)]
pub(super) struct Sites {
    /// By what is changed and where the change begins.
    pub(super) all: BTreeMap<(Genre, usize), Site>,
    /// Functions that the compiler may run.
    constant: Vec<Range<usize>>,
}

impl Sites {
    /// The sites of a source.
    pub(super) fn of(text: &str) -> Result<Self, syn::Error> {
        let file = syn::parse_file(text)?;
        let mut finder = Finder { lines: Lines::of(text), chain: Vec::new(), fixed: false, sites: Self::default() };
        finder.visit_file(&file);
        Ok(finder.sites)
    }

    /// Whether the compiler may run the function around a place: what it has run is not broken.
    pub(super) fn constant(&self, at: usize) -> bool {
        self.constant.iter().any(|range| range.contains(&at))
    }
}

/// How tight an operator binds.
pub(super) fn weight(op: &BinOp) -> u8 {
    match op {
        BinOp::Mul(_) | BinOp::Div(_) | BinOp::Rem(_) => 9,
        BinOp::Add(_) | BinOp::Sub(_) => 8,
        BinOp::Shl(_) | BinOp::Shr(_) => 7,
        BinOp::BitAnd(_) => 6,
        BinOp::BitXor(_) => 5,
        BinOp::BitOr(_) => 4,
        BinOp::Eq(_) | BinOp::Ne(_) | BinOp::Lt(_) | BinOp::Le(_) | BinOp::Gt(_) | BinOp::Ge(_) => 3,
        BinOp::And(_) => 2,
        BinOp::Or(_) => 1,
        _ => 0, // assignments
    }
}

fn lets(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) => lets(&binary.left) || lets(&binary.right),
        _ => false,
    }
}

struct Finder<'t> {
    lines: Lines<'t>,
    /// The binary expressions around what is looked at, as far as no bracket stands between.
    chain: Vec<Link>,
    /// The compiler works it out.
    fixed: bool,
    sites: Sites,
}

impl Finder<'_> {
    fn range(&self, span: Span) -> Range<usize> {
        let spot = |at: proc_macro2::LineColumn| self.lines.byte((at.line, at.column + 1)).unwrap_or_default();
        spot(span.start())..spot(span.end())
    }

    fn add(&mut self, genre: Genre, at: Span, site: Site) {
        if !self.fixed {
            let start = self.range(at).start;
            self.sites.all.insert((genre, start), site);
        }
    }

    /// Looks at what the compiler works out, or at what runs although it stands in such a place.
    fn within(&mut self, fixed: bool, look: impl FnOnce(&mut Self)) {
        let before = mem::replace(&mut self.fixed, fixed);
        let chain = mem::take(&mut self.chain);
        look(self);
        self.fixed = before;
        self.chain = chain;
    }

    fn function(&mut self, signature: &syn::Signature, block: &syn::Block) {
        if signature.constness.is_some() {
            let range = self.range(block.span());
            self.sites.constant.push(range);
        }
        self.within(false, |finder| finder.visit_block(block));
    }
}

impl<'a> Visit<'a> for Finder<'_> {
    fn visit_expr(&mut self, i: &'a Expr) {
        if matches!(i, Expr::Binary(_)) {
            visit::visit_expr(self, i);
        } else {
            self.within(self.fixed, |finder| visit::visit_expr(finder, i));
        }
    }

    fn visit_expr_binary(&mut self, i: &'a syn::ExprBinary) {
        let lets = lets(&i.left) || lets(&i.right);
        self.chain.push(Link { range: self.range(i.span()), weight: weight(&i.op), lets });
        self.add(Genre::BinaryOperator, i.op.span(), Site::Chain(self.chain.clone()));
        visit::visit_expr_binary(self, i);
        self.chain.pop();
    }

    fn visit_expr_unary(&mut self, i: &'a syn::ExprUnary) {
        self.add(Genre::UnaryOperator, i.op.span(), Site::Whole(self.range(i.span())));
        visit::visit_expr_unary(self, i);
    }

    fn visit_expr_struct(&mut self, i: &'a syn::ExprStruct) {
        if i.rest.is_some() {
            for field in &i.fields {
                self.add(Genre::StructField, field.span(), Site::Whole(self.range(i.span())));
            }
        }
        visit::visit_expr_struct(self, i);
    }

    fn visit_arm(&mut self, i: &'a syn::Arm) {
        match &i.guard {
            Some((_, guard)) => self.add(Genre::MatchArmGuard, guard.span(), Site::Whole(self.range(guard.span()))),
            None => self.add(Genre::MatchArm, i.span(), Site::Behind(self.range(i.pat.span()).end)),
        }
        visit::visit_arm(self, i);
    }

    fn visit_item_fn(&mut self, i: &'a syn::ItemFn) {
        self.function(&i.sig, &i.block);
    }

    fn visit_impl_item_fn(&mut self, i: &'a syn::ImplItemFn) {
        self.function(&i.sig, &i.block);
    }

    fn visit_trait_item_fn(&mut self, i: &'a syn::TraitItemFn) {
        if let Some(block) = &i.default {
            self.function(&i.sig, block);
        }
    }

    fn visit_expr_closure(&mut self, i: &'a syn::ExprClosure) {
        self.within(false, |finder| finder.visit_expr(&i.body));
    }

    fn visit_expr_repeat(&mut self, i: &'a syn::ExprRepeat) {
        self.visit_expr(&i.expr); // its length is a constant
    }

    fn visit_expr_const(&mut self, i: &'a syn::ExprConst) {
        self.within(true, |finder| visit::visit_expr_const(finder, i));
    }

    fn visit_item_const(&mut self, i: &'a syn::ItemConst) {
        self.within(true, |finder| visit::visit_item_const(finder, i));
    }

    fn visit_item_static(&mut self, i: &'a syn::ItemStatic) {
        self.within(true, |finder| visit::visit_item_static(finder, i));
    }

    fn visit_impl_item_const(&mut self, i: &'a syn::ImplItemConst) {
        self.within(true, |finder| visit::visit_impl_item_const(finder, i));
    }

    fn visit_trait_item_const(&mut self, i: &'a syn::TraitItemConst) {
        self.within(true, |finder| visit::visit_trait_item_const(finder, i));
    }

    fn visit_variant(&mut self, _: &'a syn::Variant) {}

    fn visit_pat(&mut self, _: &'a syn::Pat) {}

    fn visit_type(&mut self, _: &'a syn::Type) {}

    fn visit_generics(&mut self, _: &'a syn::Generics) {}

    fn visit_angle_bracketed_generic_arguments(&mut self, _: &'a syn::AngleBracketedGenericArguments) {}

    fn visit_attribute(&mut self, _: &'a syn::Attribute) {}
}
