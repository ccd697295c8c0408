#include "server/import/import.h"

#include <string>

#include "proto/error.h"
#include "server/import/peers/series.h"
#include "server/import/readers.h"

namespace isomesh::import {
namespace {

[[noreturn]] void throw_unknown_format() {
  std::string titles;
  for (const Reader& reader : readers()) {
    if (reader.sniff == nullptr) continue;
    if (!titles.empty()) titles += reader.content == Content::kFiles ? ", or " : ", ";
    titles += reader.title;
  }
  throw Error(
      ErrorCode::kUnsupportedMedia,
      "The file is not " + titles + ". If it holds raw samples, give their dims (X,Y,Z) and type.");
}

}  // namespace

Volume import_volume(const ImportTask& task, const FormatListener& listener) {
  const Input input = {.path = task.source, .companions = {}, .task = task, .listener = listener};
  if (task.options.raw) return read_raw_input(input);
  if (task.options.peers) return read_peers_series(task, listener);
  const Reader* reader = sniff(InputFile(task.source));
  if (reader == nullptr) throw_unknown_format();
  if (!task.options.member.empty() && reader->content != Content::kFiles) {
    throw invalid_parameter("member",
                            "selects a member of an archive, but this file is not an archive");
  }
  return read_input(*reader, input);
}

}  // namespace isomesh::import
