/* Set the formulas of a page: Sphinx writes \(...\) and \[...\] into elements of class "math". */
document.addEventListener("DOMContentLoaded", () => {
    if (!window.katex) return; // pages without formulas do not load it
    for (const element of document.querySelectorAll(".math.notranslate")) {
        const found = element.textContent.trim().match(/^\\([([])([^]*)\\[)\]]$/);
        if (!found) continue;
        // Sphinx puts formulas with line breaks into a "split"; tags stand outside of environments
        const text = found[2].trim().replace(/^\\begin\{split\}([^]*)\\end\{split\}$/, "$1");
        katex.render(text, element, { displayMode: found[1] === "[", throwOnError: false });
    }
});
