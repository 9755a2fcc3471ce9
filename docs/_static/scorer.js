/* Order of search results: pages that answer a question go before references, which name nearly every word. */
const PAGE_WEIGHTS = [
    [/^(installation|troubleshooting)$/, 8],
    [/^(faq|howtos|gallery|lessons\/index)$/, 6],
    [/^(lessons|concepts)\//, 4],
    [/^(api|problem_reference|kernels|index)$/, -3],
];

var Scorer = {
    score: ([page, , , , score]) => PAGE_WEIGHTS.reduce((sum, [name, more]) => sum + (name.test(page) ? more : 0), score),
    objNameMatch: 11,
    objPartialMatch: 6,
    objPrio: { 0: 15, 1: 5, 2: -5 },
    objPrioDefault: 0,
    title: 15,
    partialTitle: 7,
    term: 5,
    partialTerm: 2,
};
