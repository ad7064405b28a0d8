//! Tables for papers: LaTeX with booktabs, and longtable where a page may not hold them.

use super::document::{Document, FigureBlock, PageBlock, PictureFile, ViewerBlock};
use super::table::Table;

const PREAMBLE: &str =
    "% pdflatex report.tex, in its own folder. What the page folds away is long: it is in files.
\\documentclass[a4paper,landscape]{article}
\\usepackage[utf8]{inputenc}
\\usepackage[T1]{fontenc}
\\usepackage[margin=1.5cm]{geometry}
\\usepackage{booktabs,longtable,graphicx}
\\begin{document}
";

/// The page as a LaTeX document: the blocks that are not folded, without floats.
pub(crate) fn to_document(page: &Document) -> String {
    let body: String = page.blocks.iter().map(block).collect();
    let title = escaped(&page.title);
    format!("{PREAMBLE}\\begin{{center}}\\Large {title}\\end{{center}}\n{body}\\end{{document}}\n")
}

fn block(of: &PageBlock) -> String {
    match of {
        PageBlock::Heading(2, text) => format!("\n\\section*{{{}}}\n", escaped(text)),
        PageBlock::Heading(_, text) => format!("\n\\subsection*{{{}}}\n", escaped(text)),
        PageBlock::Text(text) => format!("{}\n\n", escaped(text)),
        PageBlock::List(items) => {
            let item = |item: &String| format!("  \\item {}\n", escaped(item));
            let items: String = items.iter().map(item).collect();
            format!("\\begin{{itemize}}\n{items}\\end{{itemize}}\n")
        }
        PageBlock::Code(code) => format!("\\begin{{verbatim}}\n{}\n\\end{{verbatim}}\n", verbatim(code)),
        PageBlock::Table(t) => format!("{{\\scriptsize\n{}}}\n", long(&t.table, &t.name, &t.caption)),
        PageBlock::Figures(figures) => figures.iter().map(figure).collect(),
        PageBlock::Wide(f) | PageBlock::Lead(f) => figure(f),
        PageBlock::Badges(badges) => {
            let badges: Vec<String> =
                badges.iter().map(|(_, text)| format!("\\textbf{{{}}}", escaped(text))).collect();
            format!("{}\n\n", badges.join(", "))
        }
        PageBlock::Viewer(viewer) => viewer.figures.iter().map(figure).collect(),
        PageBlock::Cells(viewers) => {
            let cell = |viewer: &ViewerBlock| {
                let figures: String = viewer.figures.iter().map(figure).collect();
                format!("\n\\subsection*{{{}}}\n{figures}", escaped(&viewer.cell))
            };
            viewers.iter().map(cell).collect()
        }
        PageBlock::Folded(title, _) => format!("{} is not printed here.\n\n", escaped(title)),
    }
}

fn figure(f: &FigureBlock) -> String {
    let words = format!("\\textbf{{{}}} {}", escaped(&f.title), escaped(&f.caption));
    match f.picture {
        PictureFile::Png(_) => {
            let picture = format!("\\includegraphics[width=\\linewidth]{{{}}}", f.path);
            format!(
                "\\begin{{minipage}}{{.3\\linewidth}}\\small\n{picture}\\\\\n{words}\n\\end{{minipage}}\\hfill\n"
            )
        }
        PictureFile::Svg(_) => {
            // The same plot as PDF is beside it.
            let path =
                f.path.strip_suffix("svg").map_or_else(|| f.path.clone(), |stem| format!("{stem}pdf"));
            format!(
                "\\begin{{minipage}}{{.48\\linewidth}}\\small\n\\includegraphics[width=\\linewidth]{{{path}}}\\\\\n{words}\n\
                 \\end{{minipage}}\\hfill\n"
            )
        }
    }
}

/// Most rows of a table that floats.
const FLOATS: usize = 40;

/// A table with its caption. Needs `\usepackage{booktabs}`, and `\usepackage{longtable}` where there
/// are more than 40 rows.
pub(crate) fn to_latex(table: &Table, name: &str, caption: &str) -> String {
    if table.rows.len() > FLOATS {
        return long(table, name, caption);
    }
    let Some(TabularParts { columns, header, rows, caption }) = parts(table, name, caption) else {
        return String::new();
    };
    format!(
        "\\begin{{table}}\n\\centering\n{caption}\\begin{{tabular}}{{{columns}}}\n{header}{rows}  \
         \\bottomrule\n\\end{{tabular}}\n\\end{{table}}\n"
    )
}

/// A table that may run over pages.
fn long(table: &Table, name: &str, caption: &str) -> String {
    let Some(TabularParts { columns, header, rows, caption }) = parts(table, name, caption) else {
        return String::new();
    };
    let caption = if caption.is_empty() { caption } else { format!("  {} \\\\\n", caption.trim_end()) };
    format!(
        "\\begin{{longtable}}{{{columns}}}\n{caption}{header}  \\endhead\n{rows}  \\bottomrule\n\\end{{longtable}}\n"
    )
}

/// The parts of a LaTeX table, floating or long.
struct TabularParts {
    columns: String,
    header: String,
    rows: String,
    caption: String,
}

/// None for a table without columns.
fn parts(table: &Table, name: &str, caption: &str) -> Option<TabularParts> {
    if table.header.is_empty() {
        return None;
    }
    let row = |fields: &Vec<String>| {
        let fields: Vec<String> = fields.iter().map(|f| escaped(f)).collect();
        format!("  {} \\\\\n", fields.join(" & "))
    };
    let columns = (0..table.header.len()).map(|column| if table.is_numeric(column) { 'r' } else { 'l' });
    Some(TabularParts {
        columns: columns.collect(),
        header: format!("  \\toprule\n{}  \\midrule\n", row(&table.header)),
        rows: table.rows.iter().map(row).collect(),
        caption: match caption {
            "" => String::new(),
            text => format!("\\caption{{{}}}\\label{{tab:{name}}}\n", escaped(text)),
        },
    })
}

/// Text as LaTeX prints it; numbers with an exponent or a sign as mathematics.
pub(crate) fn escaped(text: &str) -> String {
    let mut latex = String::new();
    let mut rest = text;
    let mut before = ' ';
    while let Some(first) = rest.chars().next() {
        let is_word = before.is_alphanumeric() || "_-.".contains(before);
        if let Some(length) = (!is_word).then(|| number_length(rest)).flatten() {
            latex += &number(&rest[..length]);
            before = '0';
            rest = &rest[length..];
            continue;
        }
        match first {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => latex.extend(['\\', first]),
            '\\' => latex += "\\textbackslash{}",
            '~' => latex += "\\textasciitilde{}",
            '^' => latex += "\\textasciicircum{}",
            '<' | '>' | '|' => latex.extend(['$', first, '$']),
            '`' | '\n' => latex.push(if first == '`' { '\'' } else { ' ' }),
            other => letter(&mut latex, other),
        }
        before = first;
        rest = &rest[first.len_utf8()..];
    }
    latex
}

/// Letters and signs beyond ASCII that pdflatex sets with a command: Greek, and mathematics.
const COMMANDS: [(char, &str); 57] = [
    ('α', "alpha"),
    ('β', "beta"),
    ('γ', "gamma"),
    ('δ', "delta"),
    ('ε', "varepsilon"),
    ('ϵ', "epsilon"),
    ('ζ', "zeta"),
    ('η', "eta"),
    ('θ', "theta"),
    ('ϑ', "vartheta"),
    ('ι', "iota"),
    ('κ', "kappa"),
    ('λ', "lambda"),
    ('μ', "mu"),
    ('µ', "mu"),
    ('ν', "nu"),
    ('ξ', "xi"),
    ('π', "pi"),
    ('ρ', "rho"),
    ('ϱ', "varrho"),
    ('σ', "sigma"),
    ('ς', "varsigma"),
    ('τ', "tau"),
    ('υ', "upsilon"),
    ('φ', "varphi"),
    ('ϕ', "phi"),
    ('χ', "chi"),
    ('ψ', "psi"),
    ('ω', "omega"),
    ('Γ', "Gamma"),
    ('Δ', "Delta"),
    ('Θ', "Theta"),
    ('Λ', "Lambda"),
    ('Ξ', "Xi"),
    ('Π', "Pi"),
    ('Σ', "Sigma"),
    ('Υ', "Upsilon"),
    ('Φ', "Phi"),
    ('Ψ', "Psi"),
    ('Ω', "Omega"),
    ('±', "pm"),
    ('×', "times"),
    ('·', "cdot"),
    ('−', "-"),
    ('≤', "leq"),
    ('≥', "geq"),
    ('≠', "neq"),
    ('≈', "approx"),
    ('∼', "sim"),
    ('∞', "infty"),
    ('→', "rightarrow"),
    ('←', "leftarrow"),
    ('√', "surd"),
    ('∑', "sum"),
    ('∫', "int"),
    ('∂', "partial"),
    ('∝', "propto"),
];

/// One letter. What pdflatex has no glyph for is named by its number: an unknown letter would be an error.
fn letter(latex: &mut String, letter: char) {
    if let Some((_, command)) = COMMANDS.iter().find(|(sign, _)| *sign == letter) {
        let backslash = if command.starts_with('-') { "" } else { "\\" };
        *latex += &format!("${backslash}{command}$");
    } else if is_in_font(letter) {
        latex.push(letter);
    } else {
        *latex += &number_of(letter);
    }
}

/// ASCII, the letters of western and central Europe, dashes and quotes: what the encoding T1 has.
fn is_in_font(letter: char) -> bool {
    let is_european = ('\u{a0}'..='\u{17e}').contains(&letter) && !"ĦħĸĿŀŉŦŧ".contains(letter);
    (' '..='~').contains(&letter) || is_european || "–—‘’“”„…".contains(letter)
}

fn number_of(letter: char) -> String {
    format!("U+{:04X}", u32::from(letter))
}

/// Text that is printed as it is, where no command works.
fn verbatim(text: &str) -> String {
    let shown = |letter: char| match letter.is_ascii() && (!letter.is_ascii_control() || letter == '\n')
    {
        true => letter.to_string(),
        false => number_of(letter),
    };
    text.replace("\\end{verbatim}", "\\end {verbatim}").chars().map(shown).collect()
}

/// The length of a number such as `-1.5(2)e-7` at the start of a text, if it has to be set as
/// mathematics.
fn number_length(text: &str) -> Option<usize> {
    let digits = |from: usize| text[from..].bytes().take_while(u8::is_ascii_digit).count();
    let sign = usize::from(text.starts_with(['-', '+']));
    let mut at = sign + digits(sign);
    if at == sign {
        return None;
    }
    if text[at..].starts_with('.') && digits(at + 1) > 0 {
        at += 1 + digits(at + 1);
    }
    if text[at..].starts_with('(')
        && digits(at + 1) > 0
        && text[at + 1 + digits(at + 1)..].starts_with(')')
    {
        at += digits(at + 1) + 2;
    }
    let mut has_exponent = false;
    if text[at..].starts_with('e') {
        let from = at + 1 + usize::from(text[at + 1..].starts_with(['-', '+']));
        has_exponent = digits(from) > 0;
        at = if has_exponent { from + digits(from) } else { at };
    }
    let ends = !text[at..].starts_with(|c: char| c.is_alphanumeric());
    (ends && (sign > 0 || has_exponent)).then_some(at)
}

fn number(text: &str) -> String {
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let exponent = exponent.trim_start_matches('+');
            format!("${mantissa}\\times10^{{{exponent}}}$")
        }
        None => format!("${text}$"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_set_as_they_are_meant() {
        for (text, latex) in [
            ("1.234(5)", "1.234(5)"),
            ("1.23(3)e3", "$1.23(3)\\times10^{3}$"),
            ("-0.5(2)", "$-0.5(2)$"),
            ("+1.7 [+1.4, -2.0] %", "$+1.7$ [$+1.4$, $-2.0$] \\%"),
            ("1e-6", "$1\\times10^{-6}$"),
            ("rough-0.2, b_1", "rough-0.2, b\\_1"),
            ("a & b < c\\d", "a \\& b $<$ c\\textbackslash{}d"),
            ("400-420nm", "400-420nm"),
            ("0.25 ± 0", "0.25 $\\pm$ 0"),
            ("λ = 1 µm, é", "$\\lambda$ = 1 $\\mu$m, é"),
            ("5 − 3, 中\u{7}", "5 $-$ 3, U+4E2DU+0007"),
            ("e3 3e 2x", "e3 3e 2x"),
        ] {
            assert_eq!(escaped(text), latex, "{text}");
        }
    }

    #[test]
    fn a_table_that_floats_and_one_that_does_not() {
        let mut table = Table::new(&["cell", "ratio"]);
        table.push(vec!["a_b".into(), "21.4 [20.1, 22.8]".into()]);
        let latex = "\\begin{table}\n\\centering\n\\caption{How fast.}\\label{tab:x}\n\\begin{tabular}{lr}\n  \
                     \\toprule\n  cell & ratio \\\\\n  \\midrule\n  a\\_b & 21.4 [20.1, 22.8] \\\\\n  \
                     \\bottomrule\n\\end{tabular}\n\\end{table}\n";
        assert_eq!(to_latex(&table, "x", "How fast."), latex);
        (0..40).for_each(|i| table.push(vec![i.to_string(), "1".into()]));
        let long = to_latex(&table, "x", "How fast.");
        assert!(
            long.starts_with("\\begin{longtable}{lr}")
                && long.contains("\\endhead")
                && !long.contains("{table}")
        );
        assert_eq!(to_latex(&Table::default(), "x", ""), "");
    }

    /// With pdflatex, where it is installed: every letter from space to the end of Greek, signs and other scripts.
    #[test]
    fn every_letter_compiles() {
        let folder = tempfile::tempdir().expect("a folder");
        let letters: String =
            (' '..='\u{3ff}').chain('\u{2000}'..='\u{2300}').chain("中ж😀\u{202e}".chars()).collect();
        let mut table = Table::new(&["letter", "&%$#_{}~^\\<>|`λ"]);
        let letters: Vec<String> = letters.chars().map(String::from).collect();
        letters.chunks(16).for_each(|some| table.push(vec![some.concat(), some.join(" ")]));
        let blocks = vec![PageBlock::Text(letters.join(" ")), PageBlock::Code(letters.concat())];
        let page = Document { title: "η_λ & \\input{x}".into(), blocks };
        let body =
            to_document(&page).replace("\\end{document}", &(long(&table, "x", "Δ") + "\\end{document}"));
        std::fs::write(folder.path().join("report.tex"), body).expect("a file");
        let mut command = std::process::Command::new("pdflatex");
        command
            .args(["-interaction=nonstopmode", "-halt-on-error", "report.tex"])
            .current_dir(folder.path());
        let Ok(output) = command.output() else {
            println!("left out: no pdflatex");
            return;
        };
        let log = String::from_utf8_lossy(&output.stdout).into_owned();
        let errors: Vec<&str> = log.lines().filter(|line| line.starts_with('!')).collect();
        assert!(output.status.success(), "{errors:?}");
    }
}
