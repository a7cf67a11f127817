#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "tests/support/shell.h"

namespace cohort::test {

// The real browser of this machine; empty: there is none.
inline std::string Browser() {
  for (const char* name : {"chromium", "chromium-browser", "google-chrome"}) {
    if (RunShell(fmt::format("command -v {}", name)).exit_code == 0) return name;
  }
  return "";
}

// Opens a file in it, without a network; `what` says what is wanted of it, such as --dump-dom.
inline ProgramEnd Browse(const std::filesystem::path& page,
                         const std::string& what,
                         const std::filesystem::path& home) {
  return RunShell(
      fmt::format("HOME={} timeout 100 {} --headless=new --no-sandbox --disable-gpu "
                  "--enable-unsafe-swiftshader --disable-dev-shm-usage --hide-scrollbars "
                  "--host-resolver-rules='MAP * ~NOTFOUND' --virtual-time-budget=20000 {} "
                  "'file://{}'",
                  home.string(),
                  Browser(),
                  what,
                  page.string()));
}

// A page that shows another one in a frame of this size: headless Chromium takes no window narrower
// than 500 px, phones have 360. The page within is of the same origin: its script reaches `top`.
inline std::string Framed(const std::string& html, int width_px, int height_px) {
  std::string escaped;
  for (const char c : html) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '"') {
      escaped += "&quot;";
    } else {
      escaped += c;
    }
  }
  return fmt::format(
      "<!doctype html><meta charset=\"utf-8\"><body style=\"margin:0\"><iframe width=\"{}\" "
      "height=\"{}\" style=\"border:0;display:block\" srcdoc=\"{}\"></iframe></body>",
      width_px,
      height_px,
      escaped);
}

// The page as it is, but for scripts marked `nonce="probe"`, which its policy lets run too.
inline std::string WithProbes(std::string page) {
  const std::string scripts = "script-src ";
  const std::size_t at = page.find(scripts);
  if (at == std::string::npos) throw std::runtime_error("the page has no policy for scripts");
  return page.insert(at + scripts.size(), "'nonce-probe' ");
}

// What a page's script left in <pre id="probe"> of a dumped page, unescaped; none: it left nothing.
inline std::optional<std::string> Probe(const std::string& dumped) {
  const std::string open = "<pre id=\"probe\">";
  const std::size_t begin = dumped.find(open);
  const std::size_t close = dumped.find("</pre>", begin);
  if (begin == std::string::npos || close == std::string::npos) return std::nullopt;
  std::string text = dumped.substr(begin + open.size(), close - begin - open.size());
  for (const auto& [entity, character] : {std::pair{"&lt;", "<"}, {"&gt;", ">"}, {"&amp;", "&"}}) {
    for (std::size_t at = text.find(entity); at != std::string::npos;
         at = text.find(entity, at + 1)) {
      text.replace(at, std::string(entity).size(), character);
    }
  }
  return text;
}

}  // namespace cohort::test
