//! The one user-facing error: what is wrong, where, and what to do about it.
//! The only module that uses `annotate-snippets`.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// The result of everything that can fail for a reason a user can act on.
pub type Result<T> = std::result::Result<T, Error>;

/// One thing that is wrong with an input, and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// The rule that was broken, as a sentence: ``unknown key `albdo` ``.
    pub rule: String,
    /// Where: the text and the bytes it covers.
    pub place: Option<Place>,
    /// What to do: ``did you mean `albedo`?``.
    pub help: Option<String>,
}

/// A range of bytes in a text that has a name (a file's path, or `--set`).
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The name of the text: a path, or `--set`.
    pub name: Arc<str>,
    /// Text of the input.
    pub text: Arc<str>,
    /// The bytes the finding covers.
    pub span: Range<usize>,
}

impl Place {
    /// The text that the finding covers.
    pub(crate) fn text(&self) -> &str {
        self.text.get(self.span.clone()).unwrap_or("")
    }

    /// Line and column, counted from 1, of the first byte.
    pub fn line_column(&self) -> (usize, usize) {
        let before = &self.text[..self.span.start.min(self.text.len())];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        (line, column)
    }
}

/// Findings that are shown: a mistake in a generated file comes in thousands.
const MOST_SHOWN: usize = 100;

/// Everything that can go wrong, by what the caller should do; `exit_code` states it to a shell.
#[derive(Debug)]
pub enum Error {
    /// Bad input: an experiment file, a mesh, a map, an argument. Every finding at once.
    Input(Vec<Diagnostic>),
    /// Reading or writing failed.
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was being done, as `write the record`.
        doing: String,
        /// The system's message.
        source: std::io::Error,
    },
    /// What is on disk is not what it should be (a truncated or foreign record).
    Record {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it and what to do.
        message: String,
    },
    /// The person pressed Ctrl-C; the blocks done so far are kept.
    Interrupted(String),
}

impl Error {
    /// A finding without a place in a text.
    pub fn input(rule: impl Into<String>) -> Error {
        Error::Input(vec![Diagnostic { rule: rule.into(), place: None, help: None }])
    }

    /// A finding without a place, and what to do about it.
    pub fn input_help(rule: impl Into<String>, help: impl Into<String>) -> Error {
        Error::Input(vec![Diagnostic { rule: rule.into(), place: None, help: Some(help.into()) }])
    }

    /// For `map_err`: an I/O failure at `path` while `doing`.
    pub fn io(path: &Path, doing: &str) -> impl FnOnce(std::io::Error) -> Error {
        let (path, doing) = (path.to_path_buf(), doing.to_string());
        move |source| Error::Io { path, doing, source }
    }

    /// A record that cannot be used.
    pub fn record(path: &Path, message: impl Into<String>) -> Error {
        Error::Record { path: path.to_path_buf(), message: message.into() }
    }

    /// Findings without a place get this one.
    pub(crate) fn at(self, place: Option<Place>) -> Error {
        match self {
            Error::Input(mut findings) => {
                findings.iter_mut().filter(|f| f.place.is_none()).for_each(|f| f.place = place.clone());
                Error::Input(findings)
            }
            other => other,
        }
    }

    /// Findings begin with these words.
    pub(crate) fn about(self, what: &str) -> Error {
        match self {
            Error::Input(mut findings) => {
                findings.iter_mut().for_each(|f| f.rule = format!("{what}: {}", f.rule));
                Error::Input(findings)
            }
            other => other,
        }
    }

    /// What is wrong with a file that an experiment names is bad input, whatever it is: a finding.
    pub(crate) fn of_input(self, help: &str) -> Error {
        match self {
            Error::Io { path, doing, source } => {
                Error::input_help(format!("could not {doing} `{}`: {source}", path.display()), help)
            }
            Error::Record { path, message } => {
                Error::input_help(format!("`{}`: {message}", path.display()), help)
            }
            other => other,
        }
    }

    /// The process exit code: 2 bad input, 3 I/O or unusable record, 130 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Input(_) => 2,
            Error::Io { .. } | Error::Record { .. } => 3,
            Error::Interrupted(_) => 130,
        }
    }
}

impl Error {
    /// As a terminal with colours shows it.
    pub(crate) fn to_coloured(&self) -> String {
        Told { error: self, renderer: &Renderer::styled() }.to_string()
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        Told { error: self, renderer: &Renderer::plain() }.fmt(f)
    }
}

/// An error in one style or another.
struct Told<'a> {
    error: &'a Error,
    renderer: &'a Renderer,
}

impl fmt::Display for Told<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.error {
            Error::Input(findings) => {
                for (i, finding) in findings.iter().take(MOST_SHOWN).enumerate() {
                    if i > 0 {
                        writeln!(f)?;
                    }
                    write!(f, "{}", render(finding, self.renderer))?;
                }
                if findings.len() > MOST_SHOWN {
                    write!(f, "\n\n.. and {} more", findings.len() - MOST_SHOWN)?;
                }
                if findings.len() > 1 {
                    write!(f, "\n\n{} errors", findings.len())?;
                }
                Ok(())
            }
            Error::Io { path, doing, source } => {
                write!(f, "error: could not {doing}: {}: {source}", path.display())
            }
            Error::Record { path, message } => write!(f, "error: {}: {message}", path.display()),
            Error::Interrupted(message) => write!(f, "interrupted: {message}"),
        }
    }
}

impl std::error::Error for Error {}

/// The findings of several attempts, told together: one that occurs in many cells is told once.
#[derive(Debug, Default)]
pub(crate) struct Refusals(Vec<(Diagnostic, Vec<String>)>);

impl Refusals {
    /// The value of an attempt in the cell `label`, or none, its findings being kept.
    ///
    /// # Errors
    /// What is no finding about an input.
    pub(crate) fn keep<T>(&mut self, label: &str, result: Result<T>) -> Result<Option<T>> {
        let findings = match result {
            Ok(value) => return Ok(Some(value)),
            Err(Error::Input(findings)) => findings,
            Err(other) => return Err(other),
        };
        for finding in findings {
            match self.0.iter_mut().find(|(known, _)| *known == finding) {
                Some((_, labels)) => labels.push(label.into()),
                None => self.0.push((finding, vec![label.into()])),
            }
        }
        Ok(None)
    }

    /// Nothing was refused in any of so many cells.
    ///
    /// # Errors
    /// All findings, each with the cells that it is about where others are not affected.
    pub(crate) fn none_in(self, cells: usize) -> Result<()> {
        let told = |(mut finding, mut labels): (Diagnostic, Vec<String>)| {
            labels.dedup();
            // A finding about the whole experiment has no cell.
            labels.retain(|label| !label.is_empty());
            match &labels[..] {
                several if several.len() >= cells => {}
                [one] => finding.rule += &format!(" (cell `{one}`)"),
                [first, rest @ ..] => {
                    finding.rule += &format!(" (cell `{first}` and {} more)", rest.len());
                }
                [] => {}
            }
            finding
        };
        let findings: Vec<Diagnostic> = self.0.into_iter().map(told).collect();
        if findings.is_empty() { Ok(()) } else { Err(Error::Input(findings)) }
    }
}

fn render(finding: &Diagnostic, renderer: &Renderer) -> String {
    let Some(place) = &finding.place else {
        let help = finding.help.as_ref().map(|h| format!("\n  help: {h}")).unwrap_or_default();
        return format!("error: {}{help}", finding.rule);
    };
    let snippet = Snippet::source(&*place.text)
        .path(&*place.name)
        .annotation(AnnotationKind::Primary.span(place.span.clone()));
    let title = Level::ERROR.primary_title(&*finding.rule).element(snippet);
    let mut groups: Vec<Group> = Vec::new();
    match &finding.help {
        Some(help) => groups.push(title.element(Level::HELP.message(&**help))),
        None => groups.push(title),
    }
    renderer.render(&groups).to_string()
}
