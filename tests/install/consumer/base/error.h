// A header of the consumer project with the same name as one of the library.
#pragma once

#define CONSUMER_BASE_ERROR_H 1
