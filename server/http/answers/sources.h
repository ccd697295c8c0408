// Bodies that are made while they are sent.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/http/request_values.h"
#include "server/net/sender.h"
#include "server/store/blob_store.h"

namespace isomesh::http {

// Part of a blob.
std::unique_ptr<net::Source> blob_source(std::unique_ptr<store::BlobReader> blob,
                                         const ByteRange& part);

// A text that stays where it is for as long as the process runs.
std::unique_ptr<net::Source> text_source(std::string_view text);

// The next bytes of a body, none at its end. Some may be empty. What it throws cuts the body off.
using NextPiece = std::function<std::optional<std::string>()>;

// A body that is computed in pieces. In chunks (RFC 9112, 7.1), or bare for receivers that know
// only the connection's end.
std::unique_ptr<net::Source> computed_source(NextPiece next, bool in_chunks);

}  // namespace isomesh::http
