// The editor's page, one self-contained HTML file (generated from this folder by cmake/WriteEditorPage.cmake).
#pragma once

namespace editnerf {

// Its style sheet and script carry nonce="{{nonce}}".
const char* EditorPage();

}  // namespace editnerf
