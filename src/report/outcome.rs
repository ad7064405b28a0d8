//! A page for verdicts that belong to no single record: those of `judge` and `compare`.

use super::answer::badges;
use super::document::{Document, FigureBlock, PageBlock, TableBlock};
use super::html::to_html;
use super::tables::verdict_table;
use super::undecided::undecided;
use crate::verify::verdict::Verdict;

/// The page as HTML: badges, what was said in sentences, pictures, causes of what is not decided, and the verdicts.
pub(crate) fn page(
    title: &str,
    sentences: Vec<String>,
    figures: Vec<FigureBlock>,
    verdicts: &[Verdict],
) -> String {
    let mut blocks: Vec<PageBlock> = badges(verdicts).into_iter().collect();
    blocks.extend((!sentences.is_empty()).then_some(PageBlock::List(sentences)));
    if !figures.is_empty() {
        blocks.push(PageBlock::Heading(2, "Pictures".into()));
        blocks.push(PageBlock::Figures(figures));
    }
    let (green, others): (Vec<_>, Vec<_>) = verdicts.iter().cloned().partition(|v| v.is_green());
    if !others.is_empty() {
        blocks.push(PageBlock::Heading(2, "Verdicts that are not green".into()));
        let groups: Vec<String> =
            undecided(verdicts).iter().map(|group| format!("{}.", group.sentence())).collect();
        blocks.extend((!groups.is_empty()).then_some(PageBlock::List(groups)));
        blocks.push(table("verdicts-not-green", &others));
    }
    if !green.is_empty() {
        let title = format!("The {} verdicts that are green", green.len());
        blocks.push(PageBlock::Heading(2, "Verdicts that are green".into()));
        blocks.push(PageBlock::Folded(title, vec![table("verdicts-green", &green)]));
    }
    to_html(&Document { title: title.into(), blocks })
}

fn table(name: &str, verdicts: &[Verdict]) -> PageBlock {
    PageBlock::Table(TableBlock::new(name, "", verdict_table(verdicts)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::document::PictureFile;
    use crate::results::sample;
    use crate::verify::judge::judge_alone;

    #[test]
    fn the_outcome_is_at_the_top_and_sections_are_not_empty() {
        let verdicts = judge_alone(&sample::judged(&[("holds", 1.0), ("does not", 2.0)]));
        let figure = FigureBlock {
            path: "z.png".into(),
            picture: PictureFile::Png(vec![1, 2]),
            title: "z".into(),
            caption: "a map".into(),
        };
        let html = page("two & two", vec!["a sentence".into()], vec![figure], &verdicts);
        let head = html.split("<h2").next().expect("a head");
        assert!(head.contains("1 of 2 comparisons holds") && head.contains("1 fails"), "{head}");
        assert!(head.contains("a sentence") && head.contains("two &amp; two"));
        assert!(html.contains("src=\"data:image/png") && html.contains("does not"));
        let one = page("x", vec![], vec![], &verdicts[..1]);
        assert!(!one.contains(">Pictures<") && !one.contains("not green"), "{one}");
    }
}
