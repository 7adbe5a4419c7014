//! Integer expressions of `#if` and `#elif`.

use super::lex::{Kind, Token};

/// Deepest nesting of operators and parentheses.
const DEPTH_MAX: usize = 64;

/// Why an expression has no value: what is wrong, and the token at fault, none at the end.
#[derive(Debug)]
pub struct Fault {
    /// What is wrong.
    pub message: String,
    /// Index of the token.
    pub at: usize,
}

/// Evaluates macro-expanded tokens; an identifier that is left counts as 0, as an undefined feature does.
pub fn evaluate(tokens: &[Token]) -> Result<i64, Fault> {
    let mut parser = Parser { tokens, at: 0, depth: 0 };
    let value = parser.binary(0)?;
    match tokens.get(parser.at) {
        None => Ok(value),
        Some(token) => Err(parser.fault(format!("expected an operator, found `{}`", token.text))),
    }
}

struct Parser<'a> {
    tokens: &'a [Token],
    at: usize,
    depth: usize,
}

/// How tight an operator binds; the higher, the tighter.
fn precedence(operator: &str) -> Option<u32> {
    Some(match operator {
        "||" => 1,
        "&&" => 2,
        "|" => 3,
        "^" => 4,
        "&" => 5,
        "==" | "!=" => 6,
        "<" | ">" | "<=" | ">=" => 7,
        "<<" | ">>" => 8,
        "+" | "-" => 9,
        "*" | "/" | "%" => 10,
        _ => return None,
    })
}

impl Parser<'_> {
    fn fault(&self, message: impl Into<String>) -> Fault {
        Fault { message: message.into(), at: self.at }
    }

    fn text(&self) -> &str {
        self.tokens.get(self.at).map_or("", |token| &token.text)
    }

    fn binary(&mut self, tightness: u32) -> Result<i64, Fault> {
        let mut left = self.unary()?;
        while let Some(tight) = precedence(self.text()).filter(|tight| *tight > tightness) {
            let (at, operator) = (self.at, self.text().to_owned());
            self.at += 1;
            let right = self.binary(tight)?;
            left = apply(&operator, left, right)
                .ok_or_else(|| Fault { message: "division by zero in a condition".to_owned(), at })?;
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<i64, Fault> {
        if self.depth == DEPTH_MAX {
            return Err(self.fault(format!("conditions nest at most {DEPTH_MAX} deep")));
        }
        self.depth += 1;
        let value = self.term();
        self.depth -= 1;
        value
    }

    fn term(&mut self) -> Result<i64, Fault> {
        let Some(token) = self.tokens.get(self.at) else {
            return Err(self.fault("expected a value in this condition"));
        };
        self.at += 1;
        match (token.kind, &*token.text) {
            (Kind::Word, _) => Ok(0),
            (Kind::Number, text) => integer(text).ok_or_else(|| {
                self.at -= 1;
                self.fault(format!("`{text}` is no integer"))
            }),
            (_, "!") => Ok(i64::from(self.unary()? == 0)),
            (_, "-") => Ok(self.unary()?.wrapping_neg()),
            (_, "+") => self.unary(),
            (_, "~") => Ok(!self.unary()?),
            (_, "(") => {
                let value = self.binary(0)?;
                if self.text() != ")" {
                    return Err(self.fault("expected `)` in this condition"));
                }
                self.at += 1;
                Ok(value)
            }
            (_, text) => {
                let message = format!("expected a value, found `{text}`");
                self.at -= 1;
                Err(self.fault(message))
            }
        }
    }
}

/// The value of an integer literal, decimal, octal or hexadecimal, with or without `u`.
pub fn integer(text: &str) -> Option<i64> {
    let digits = text.trim_end_matches(['u', 'U']);
    if let Some(hex) = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        return i64::from_str_radix(hex, 16).ok();
    }
    match digits.strip_prefix('0') {
        Some(octal) if !octal.is_empty() => i64::from_str_radix(octal, 8).ok(),
        _ => digits.parse().ok(),
    }
}

fn apply(operator: &str, left: i64, right: i64) -> Option<i64> {
    let shift = u32::try_from(right & 63).unwrap_or(0);
    Some(match operator {
        "||" => i64::from(left != 0 || right != 0),
        "&&" => i64::from(left != 0 && right != 0),
        "|" => left | right,
        "^" => left ^ right,
        "&" => left & right,
        "==" => i64::from(left == right),
        "!=" => i64::from(left != right),
        "<" => i64::from(left < right),
        ">" => i64::from(left > right),
        "<=" => i64::from(left <= right),
        ">=" => i64::from(left >= right),
        "<<" => left.wrapping_shl(shift),
        ">>" => left.wrapping_shr(shift),
        "+" => left.wrapping_add(right),
        "-" => left.wrapping_sub(right),
        "*" => left.wrapping_mul(right),
        "/" if right != 0 => left.wrapping_div(right),
        "%" if right != 0 => left.wrapping_rem(right),
        _ => return None,
    })
}
