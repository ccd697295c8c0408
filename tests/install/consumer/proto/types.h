// A header of the consumer project with the same name as one of the library.
#pragma once

#define CONSUMER_PROTO_TYPES_H 1
