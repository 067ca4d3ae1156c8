"""Words that C, C++, POSIX or their headers have taken: what a generated function must not be called."""

from __future__ import annotations

import re

_C = """auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    alignas alignof bool constexpr false nullptr static_assert thread_local true typeof typeof_unqual asm main"""
_CPP = """and and_eq bitand bitor catch char8_t char16_t char32_t class co_await co_return co_yield compl concept
    const_cast consteval constinit decltype delete dynamic_cast explicit export friend mutable namespace new noexcept
    not not_eq operator or or_eq private protected public reinterpret_cast requires static_cast template this throw
    try typeid typename using virtual wchar_t xor xor_eq"""
_MATH = """acos asin atan atan2 cos sin tan acosh asinh atanh cosh sinh tanh exp exp2 expm1 frexp ilogb ldexp log log10
    log1p log2 logb modf scalbn scalbln cbrt fabs hypot pow sqrt erf erfc lgamma tgamma ceil floor nearbyint rint
    lrint llrint round lround llround trunc fmod remainder remquo copysign nan nextafter nexttoward fdim fmax fmin
    fma fpclassify isfinite isinf isnan isnormal signbit isgreater isgreaterequal isless islessequal islessgreater
    isunordered float_t double_t j0 j1 jn y0 y1 yn gamma"""  # the last line: beside the standard, on many systems
_HEADERS = """assert complex ctype errno fenv inttypes iso646 limits locale math setjmp signal stdarg stdbool stddef
    stdint stdio stdlib string tgmath time wchar wctype"""
# What the headers of C, of POSIX and of their common extensions declare beside, and words that some systems define as
# macros; without families and variants, which are rules below.
_LIBRARY = """
    a64l abort abs accept accept4 access acct adjtime alarm aligned_alloc alloca alphasort arc4random
    arc4random_buf arc4random_uniform asctime asprintf assert_perror at_quick_exit atexit atof atoi atol atoll
    basename bcmp bcopy be16toh be32toh be64toh bind bindresvport bindresvport6 brk bsearch btowc bzero c16rtomb
    c32rtomb c8rtomb cabs cacos cacosh call_once calloc canonicalize canonicalize_file_name carg casin casinh catan
    catanh catclose catgets catopen ccos ccosh cdecl cexp cfgetispeed cfgetospeed cfmakeraw cfsetispeed cfsetospeed
    cfsetspeed chdir chmod chown chroot cimag clearenv clearerr clock clog clog10 clone close close_range closedir
    closefrom closelog confstr conj connect copy_file_range cpow cproj creal creat crypt csin csinh csqrt ctan ctanh
    ctermid ctime cuserid daemon daylight difftime dirfd dirname div dladdr dladdr1 dlclose dlerror dlinfo dlmopen
    dlopen dlsym dlvsym dprintf drand48 drem dup dup2 dup3 duplocale dysize eaccess ecvt endgrent endhostent
    endnetent endnetgrent endprotoent endpwent endrpcent endservent endusershell environ erand48 err error errx
    euidaccess execl execle execlp execv execve execveat execvp execvpe exit exp10 explicit_bzero faccessat
    fallocate far fchdir fchmod fchmodat fchown fchownat fclose fcloseall fcntl fcvt fd_mask fd_set fdatasync fdopen
    fdopendir feclearexcept fedisableexcept feenableexcept fegetenv fegetexcept fegetexceptflag fegetmode fegetround
    feholdexcept feof feraiseexcept ferror fesetenv fesetexcept fesetexceptflag fesetmode fesetround fetestexcept
    fetestexceptflag feupdateenv fexecve fflush ffs ffsl ffsll fgetc fgetgrent fgetpos fgetpwent fgets fgetwc fgetws
    fileno finite flockfile fmaximum fmaximum_mag fmaximum_mag_num fmaximum_num fmaxmag fmemopen fminimum
    fminimum_mag fminimum_mag_num fminimum_num fminmag fnmatch fopen fopencookie fork fpathconf fprintf fputc fputs
    fputwc fputws fread free freeaddrinfo freelocale freopen fromfp fromfpx fscanf fseek fseeko fsetpos fstat
    fstatat fstatvfs fsync ftell ftello ftok ftruncate ftrylockfile ftw funlockfile futimens futimes futimesat fwide
    fwprintf fwrite fwscanf gai_cancel gai_error gai_strerror gai_suspend gcvt get_current_dir_name getaddrinfo
    getaddrinfo_a getc getchar getcpu getcwd getdate getdate_err getdelim getdents64 getdirentries getdomainname
    getdtablesize getegid getentropy getenv geteuid getgid getgrent getgrgid getgrnam getgrouplist getgroups
    gethostbyaddr gethostbyname gethostbyname2 gethostent gethostid gethostname getipv4sourcefilter getitimer
    getline getloadavg getlogin getnameinfo getnetbyaddr getnetbyname getnetent getnetgrent getopt getpagesize
    getpass getpayload getpeername getpgid getpgrp getpid getppid getpriority getprotobyname getprotobynumber
    getprotoent getpt getpw getpwent getpwnam getpwuid getresgid getresuid getrlimit getrpcbyname getrpcbynumber
    getrpcent getrusage gets getservbyname getservbyport getservent getsid getsockname getsockopt getsourcefilter
    getsubopt gettid gettimeofday getuid getumask getusershell getw getwc getwchar getwd glob globfree gmtime
    grantpt group_member gsignal hcreate hdestroy herror hsearch hstrerror htobe16 htobe32 htobe64 htole16 htole32
    htole64 htonl htons hyper iconv iconv_close iconv_open imaxabs imaxdiv index initgroups initstate innetgr insque
    interface iruserok iruserok_af isalnum isalpha isascii isatty isblank iscanonical iscntrl isctype isdigit
    iseqsig isfdtype isgraph islower isprint ispunct issignaling isspace issubnormal isupper iswalnum iswalpha
    iswblank iswcntrl iswctype iswdigit iswgraph iswlower iswprint iswpunct iswspace iswupper iswxdigit isxdigit
    iszero jmp_buf jrand48 kill kill_dependency killpg l64a labs lchmod lchown lcong48 ldiv le16toh le32toh le64toh
    lfind link linkat linux lio_listio listen llabs lldiv llogb localeconv localtime lockf longjmp lrand48 lsearch
    lseek lstat lutimes madvise malloc math_errhandling max mblen mbrlen mbrtoc16 mbrtoc32 mbrtoc8 mbrtowc mbsinit
    mbsnrtowcs mbsrtowcs mbstowcs mbtowc memccpy memchr memcmp memcpy memfd_create memfrob memmem memmove
    memory_order mempcpy memrchr memset min mincore mkdir mkdirat mkdtemp mkfifo mkfifoat mknod mknodat mkostemp
    mkostemps mkstemp mkstemps mktemp mktime mlock mlock2 mlockall mmap mprotect mrand48 mremap msg_cbytes msgctl
    msgget msgrcv msgsnd msync munlock munlockall munmap name_to_handle_at nanosleep near newlocale nextdown nextup
    nftw nice noreturn nrand48 ntohl ntohs obstack_printf obstack_vprintf offsetof on_exit once_flag open
    open_by_handle_at open_memstream open_wmemstream openat opendir openlog optarg opterr optind optopt pascal
    pathconf pause pclose perror pipe pipe2 poll popen ppoll pread preadv preadv2 preadv64v2 printf prlimit
    process_madvise process_mrelease process_vm_readv process_vm_writev profil program_invocation_name
    program_invocation_short_name pselect psiginfo psignal ptsname putc putchar putenv putgrent putpwent puts putw
    putwc putwchar pwrite pwritev pwritev2 pwritev64v2 qecvt qfcvt qgcvt qsort quick_exit raise rand random
    rawmemchr rcmd rcmd_af read readahead readdir readlink readlinkat readv realloc reallocarray realpath recv
    recvfrom recvmmsg recvmsg regcomp regerror regexec regfree remap_file_pages remove remque rename renameat
    renameat2 revoke rewind rewinddir rexec rexec_af rindex rmdir roundeven rpmatch rresvport rresvport_af ruserok
    ruserok_af sbrk scalb scandir scandirat scanf secure_getenv seed48 seekdir select semctl semget semop semtimedop
    send sendmmsg sendmsg sendto setbuf setbuffer setdomainname setegid setenv seteuid setgid setgrent setgroups
    sethostent sethostid sethostname setipv4sourcefilter setitimer setlinebuf setlocale setlogin setlogmask
    setnetent setnetgrent setns setpayload setpayloadsig setpgid setpgrp setpriority setprotoent setpwent setregid
    setresgid setresuid setreuid setrlimit setrpcent setservent setsid setsockopt setsourcefilter setstate
    settimeofday setuid setusershell setvbuf shmat shmctl shmdt shmget shutdown sigabbrev_np sigaction sigaddset
    sigaltstack sigandset sigblock sigdelset sigdescr_np sigemptyset sigfillset siggetmask sighold sigignore
    siginterrupt sigisemptyset sigismember sigjmp_buf siglongjmp sigmask signgam significand sigorset sigpause
    sigpending sigprocmask sigqueue sigrelse sigreturn sigset sigsetjmp sigsetmask sigstack sigsuspend sigtimedwait
    sigwait sigwaitinfo sincos sleep small snprintf sockatmark socket socketpair splice sprintf srand srand48
    srandom sscanf ssignal stat statvfs statx stderr stdin stdout stpcpy stpncpy strcasecmp strcasestr strcat
    strchr strchrnul strcmp strcoll strcpy strcspn strdup strdupa strerror strerrordesc_np strerrorname_np strfmon
    strfromd strfromf strfroml strfry strftime strlen strncasecmp strncat strncmp strncpy strndup strndupa strnlen
    strpbrk strptime strrchr strsep strsignal strspn strstr strtod strtof strtoimax strtok strtol strtold strtoll
    strtoq strtoul strtoull strtoumax strtouq strverscmp strxfrm swab swprintf swscanf symlink symlinkat sync
    sync_file_range syncfs syscall sysconf syslog system sysv_signal tcdrain tcflow tcflush tcgetattr tcgetpgrp
    tcgetsid tcsendbreak tcsetattr tcsetpgrp tdelete tdestroy tee telldir tempnam tfind tgkill timegm timelocal
    timeradd timerclear timercmp timerisset timersub times timezone tmpfile tmpnam toascii tolower totalorder
    totalordermag toupper towctrans towlower towupper truncate tsearch ttyname ttyslot twalk tzname tzset u_char
    u_int u_long u_short ualarm ufromfp ufromfpx uint ulong umask uname ungetc ungetwc unix unlink unlinkat unlockpt
    unsetenv unshare uselocale ushort usleep utime utimensat utimes valloc vasprintf vdprintf versionsort vfork
    vfprintf vfscanf vfwprintf vfwscanf vhangup vmsplice vprintf vscanf vsnprintf vsprintf vsscanf vswprintf
    vswscanf vsyslog vwprintf vwscanf wait wait3 wait4 waitid waitpid warn warnx wcpcpy wcpncpy wcrtomb wcscasecmp
    wcscat wcschr wcschrnul wcscmp wcscoll wcscpy wcscspn wcsdup wcsftime wcslen wcsncasecmp wcsncat wcsncmp wcsncpy
    wcsnlen wcsnrtombs wcspbrk wcsrchr wcsrtombs wcsspn wcsstr wcstod wcstof wcstoimax wcstok wcstol wcstold wcstoll
    wcstombs wcstoq wcstoul wcstoull wcstoumax wcstouq wcswcs wcswidth wcsxfrm wctob wctomb wctrans wcwidth wmemchr
    wmemcmp wmemcpy wmemmove wmempcpy wmemset wordexp wordfree wprintf write writev wscanf"""
_FAMILIES = re.compile(
    "(aio|atomic|clock|cnd|fe|if|inet6?|in6addr|mq|mtx|nl|posix|pkey|pthread|sched|sem|shm|sig|st|thrd|timer|timespec|tss|va)_"
    "|(PRI|SCN)[a-zX]|[fd](add|sub|mul|div|fma|sqrt)l?$"
)
_VARIANTS = re.compile(r"(_l|_r|_unlocked|f|l|d|64|64_r|f?(16|32|32x|64|64x|128))$")
_TAKEN = frozenset(f"{_C} {_CPP} {_MATH} {_HEADERS} {_LIBRARY}".split())


def is_reserved(name: str) -> bool:
    """Whether a header may declare or define the name.

    Macros are in capitals, types of POSIX end in _t, and a function of the library has variants for other types,
    locales and threads: `sinf`, `strtol_l`, `getc_unlocked`.
    """
    return (
        name in _TAKEN
        or name.upper() == name
        or name.endswith("_t")
        or bool(_FAMILIES.match(name))
        or _VARIANTS.sub("", name) in _TAKEN
    )
