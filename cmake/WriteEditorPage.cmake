# cmake -DFOLDER=apps/editor -DOUT=editor_page.cpp -P WriteEditorPage.cmake: index.html with the style sheet and the
# scripts in it, as a function that returns it.
cmake_minimum_required(VERSION 3.22)
file(READ ${FOLDER}/index.html page)
file(READ ${FOLDER}/editor.css style)
# Parts of one module script, joined in this order: they share its scope, and nothing has to be fetched.
set(script "")
foreach(part geometry server picture overview trail motion editor)
  file(READ ${FOLDER}/${part}.js text)
  string(APPEND script "${text}\n")
endforeach()
string(REPLACE "/* editor.css */" "${style}" page "${page}")
string(REPLACE "/* editor.js */" "${script}" page "${page}")
# String literals may be limited to 64 KiB: pieces of 8000 characters, which the compiler joins.
string(LENGTH "${page}" length)
set(pieces "")
set(at 0)
while(at LESS length)
  string(SUBSTRING "${page}" ${at} 8000 piece)
  string(APPEND pieces "    R\"page(${piece})page\"\n")
  math(EXPR at "${at} + 8000")
endwhile()
file(WRITE ${OUT} "// Generated from apps/editor/ by cmake/WriteEditorPage.cmake.
#include \"editor/editor_page.h\"

namespace editnerf {

const char* EditorPage() {
  return
${pieces}      ;
}

}  // namespace editnerf
")
