// Unpacks the page's script, which is most of it, once the tables are on the screen.
window.addEventListener('load', () => setTimeout(async () => {
  try {
    const bytes = Uint8Array.from(atob(document.getElementById('packed').textContent), (one) => one.charCodeAt(0));
    const script = document.createElement('script');
    script.textContent = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).text();
    document.body.append(script);
  } catch (error) {
    const box = document.getElementById('failure');
    box.hidden = false;
    box.textContent = `This report could not be drawn: ${error.message}. Its tables are below.`;
  }
}));
