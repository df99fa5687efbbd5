"""Names that MicroPython's firmware has, so that they cost a program nothing, see the package."""

STATIC = """
ArithmeticError AssertionError AttributeError BaseException EOFError Ellipsis Exception GeneratorExit
ImportError IndentationError IndexError KeyError KeyboardInterrupt LookupError MemoryError NameError
NotImplementedError OSError OverflowError RuntimeError StopIteration SyntaxError SystemExit TypeError
ValueError ZeroDivisionError abs all any append bool bytearray bytes callable chr classmethod clear close copy
count dict dir divmod endswith eval exec extend find format from_bytes get getattr globals hasattr hash id
index insert int isalpha isdigit isinstance islower isspace issubclass isupper items iter join keys len list
locals lower lstrip map next object open ord pop popitem pow print read readinto readline remove replace repr
reverse rfind rindex round rsplit rstrip send sep set setattr setdefault sort sorted split startswith
staticmethod stop str strip sum to_bytes tuple type update upper values write zip
""".split()
"""What every MicroPython has: a compiled file refers to these by number."""

COMMON = """
e gc io os pi re EIO GS8 INT PTR RAW add bin cos erf exp hex inf log max min nan oct ps1 ps2 sin sub sys tan
tau vfs AUTO GZIP INT8 LONG Lock Loop Task UINT VOID ZLIB acos argv asin atan blit ceil core cosh dump erfc
exit fabs fill fmod help json line load log2 math modf pack path peek poll poly push rect seed seek sinh sqrt
stat tanh tell text time wait ARRAY EBADF EPERM Event INT16 INT32 INT64 MVLSB SHORT UINT8 ULONG acosh array
asinh atan2 atanh chdir cmath crc32 deque dumps event expm1 float floor flush frexp gamma heapq hline input
ioctl isinf isnan ldexp loads log10 match mkdir mount phase pixel polar rmdir sleep slice stdin ticks trunc
union vline BFINT8 BF_LEN BF_POS EACCES EAGAIN EEXIST EINVAL EISDIR ENODEV ENOENT ENOMEM IOBase NATIVE POLLIN
RGB565 RingIO UINT16 UINT32 UINT64 USHORT center choice decode digest enable encode filter gather getcwd
getter gmtime is_set lgamma locked mktime random rename scroll search select setter sha256 sizeof stderr
stdout struct umount unlink unpack BFINT16 BFINT32 BFUINT8 BytesIO ENOBUFS FLOAT32 FLOAT64 POLLERR POLLHUP
POLLOUT acquire asyncio collect compile complex deflate degrees delattr deleter disable discard ellipse
fromhex hashlib heapify heappop hexlify isclose listdir maxsize modules popleft radians randint release
statvfs time_ns uctypes uniform version BFUINT16 BFUINT32 EALREADY ENOTCONN GS2_HMSB GS4_HMSB LONGLONG
StringIO VfsPosix binascii bytes_at calcsize copysign cur_task execfile framebuf fromkeys getvalue heappush
ilistdir isfinite issubset kbd_intr libc_ver mem_free mem_info platform property reversed schedule sleep_ms
sleep_us ticks_ms ticks_us wait_for DeflateIO ETIMEDOUT MONO_HLSB MONO_HMSB MONO_VLSB TaskQueue ULONGLONG
addressof byteorder enumerate errorcode factorial fill_rect frozenset heap_lock isenabled localtime mem_alloc
opt_level pack_into partition qstr_info randrange stack_use threshold ticks_add ticks_cpu unhexlify BIG_ENDIAN
EADDRINUSE ECONNRESET EOPNOTSUPP a2b_base64 appendleft b2a_base64 difference isdisjoint issuperset memoryview
namedtuple rpartition splitlines ticks_diff EINPROGRESS FrameBuffer OrderedDict collections create_task
getrandbits heap_unlock unpack_from wait_for_ms ECONNABORTED ECONNREFUSED EHOSTUNREACH FrameBuffer1
TimeoutError UnicodeError bytearray_at current_task intersection version_info LITTLE_ENDIAN CancelledError
NotImplemented ThreadSafeFlag get_event_loop implementation new_event_loop print_exception python_compiler
difference_update SingletonGenerator StopAsyncIteration intersection_update symmetric_difference
get_exception_handler set_exception_handler call_exception_handler default_exception_handler
symmetric_difference_update
""".split()
"""What the unix port and the WebAssembly port both have, short ones first; most boards have nearly all of it."""

OFFERED = frozenset(
    """
UART any baudrate bits cts deinit flow init invert irq machine parity rts rx rxbuf stop timeout timeout_char tx txbuf
AF_INET AF_INET6 SOCK_DGRAM SOCK_STREAM SOL_SOCKET SO_REUSEADDR SO_BROADCAST IPPROTO_IP IPPROTO_TCP TCP_NODELAY
accept bind connect fileno getaddrinfo ipoll listen makefile modify recv recvfrom register send sendall sendto
setblocking setsockopt settimeout shutdown socket unregister inet_pton sockaddr
tcgetattr tcsetattr setraw TCSANOW termios read write open urandom
NATIVE args errno value name implementation modules
""".split()
)
"""What the floor uses of modules that only some firmware has, and so may not rename."""
